// The engine of a page: opens volumes and draws scenes of them, in a worker of a browser. Each
// worker has an engine of its own, and draws some rows of each picture.
//
// engine_call() takes a request, JSON, and returns its answer, JSON: {"error": "..."}, or what the
// request's "what" gives:
//
//   open    path, keep: keep the .zfp file's bytes -> facts of the volume, as the viewer's
//   "welcome"
//           has them; bytes of a .zfp file if it was none. chunks: path has the head of a file of
//           chunks, and this is the file's size. field: path of a second volume -> its range and
//           type, too
//   supply  path, parts [[begin, end], ...] of that file, whose bytes path has one behind the other
//   scene   text -> fields: the scene's, without those that have their defaults
//   camera  scene, size [width, height] -> camera, which the surfaces fill
//   draw    scene, size, samples, ambient, rows [begin, end] -> what was drawn; bytes: RGBA of
//           these rows. annotated: size of the picture that gets the scene's annotations -> them,
//           as JSON; none if that size is too small for them
//   probe   scene, size, at [x, y], 0 to 1 -> position; value and field's there: what is seen, or
//           null
//   histogram  -> counts, range, suggested isovalues
//
// An answer may be {"missing": [[begin, end], ...]} instead: parts of the file of chunks without
// which the request cannot be answered. When they were supplied, it is made again.

#include <emscripten.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/api/guarded.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/api/voxel_histogram.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/io/input_file.hpp"
#include "core/view/trigonometry.hpp"
#include "core/zfp/chunk_file.hpp"
#include "core/zfp/voxel_region.hpp"
#include "core/zfp/zfp_file.hpp"
#include "isowave/host.hpp"
#include "isowave/scene.hpp"

namespace isowave {

namespace {

using nlohmann::json;

/// Bounds of the blocks that stay decoded, and of the chunks that stay when a picture is done.
constexpr std::uint64_t kDecodedBytes = 384u << 20, kChunkBytes = 128u << 20;

std::vector<std::byte> read_file(const std::string &path) {
  const core::InputFile file(path);
  std::vector<std::byte> bytes(file.size());
  file.read(0, bytes);
  return bytes;
}

/// The volume without its file.
core::CompressedVolume read_whole(const Volume &volume) {
  core::CompressedVolume whole = volume.implementation().volume;
  if (!whole.chunks) whole.coarser_levels.clear();  // the finest draws all
  if (whole.file) {
    whole.words.resize(whole.word_count());
    whole.read_words(0, whole.words);
    whole.file.reset();
    whole.file_first_bit = 0;
  }
  return whole;
}

/// A volume, and what draws it.
struct Opened {
  /// second  a field that colours surfaces; null: the volume itself
  Opened(std::shared_ptr<const Volume> of, std::shared_ptr<const Volume> second)
      : volume(std::move(of)), field(std::move(second)), in_memory(read_whole(*volume)) {
    if (field) field_in_memory = read_whole(*field);
    const std::uint64_t of_field = field ? core::HostBlocks::bytes(field_in_memory.info) : 0,
                        limit = core::HostLevels::least_bytes(in_memory, ISO_MAX_SURFACES, true) +
                                of_field + kDecodedBytes;
    auto on_host = std::make_unique<core::HostRenderer>(
        in_memory, core::HostRendererOptions{.memory_limit = limit,
                                             .num_threads = 1,
                                             .field = field ? &field_in_memory : &in_memory});
    host = on_host.get();
    auto implementation = std::make_unique<Renderer::Implementation>(std::make_shared<Turns>(),
                                                                     volume, std::move(on_host));
    implementation->field = field ? field : volume;
    renderer.emplace(std::move(implementation));
  }
  Opened(const Opened &) = delete;
  Opened &operator=(const Opened &) = delete;

  /// The chunks of all levels.
  std::vector<core::BlockChunks *> chunks() const {
    std::vector<core::BlockChunks *> all;
    if (in_memory.chunks) all.push_back(in_memory.chunks.get());
    for (const core::CompressedVolume &level : in_memory.coarser_levels)
      all.push_back(level.chunks.get());
    return all;
  }
  /// The parts of its file that were missed since the last call.
  json take_missing() const {
    json parts = json::array();
    for (core::BlockChunks *of_level : chunks()) {
      for (const core::FilePart &part : of_level->take_missing())
        parts.push_back({part.begin, part.end});
    }
    return parts;
  }

  std::shared_ptr<const Volume> volume, field;
  core::CompressedVolume in_memory, field_in_memory{};  ///< which rays read from
  core::HostRenderer *host = nullptr;
  std::optional<Renderer> renderer;
  /// A request that waits for chunks, and what was drawn for it.
  std::string waiting{};
  std::uint64_t hits = 0, decoded_blocks = 0, rays_cut = 0;
};

std::unique_ptr<Opened> opened;
std::vector<std::uint8_t> bytes;

/// Columns: from indices to the world.
glm::dmat3 axes_of(const Grid &grid) {
  glm::dmat3 axes(1);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k)
      axes[i][k] = grid.direction[std::size_t(i)][std::size_t(k)] * grid.spacing[std::size_t(i)];
  }
  return axes;
}

glm::dvec3 origin_of(const Grid &grid) {
  return {grid.origin[0], grid.origin[1], grid.origin[2]};
}

/// The least box around the voxels with edges along the world's axes.
json box_of(const Grid &grid) {
  const glm::dmat3 axes = axes_of(grid);
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
  for (unsigned corner = 0; corner < 8; ++corner) {
    glm::dvec3 at(0);
    for (int i = 0; i < 3; ++i)
      at[i] = (corner >> i & 1u) != 0 ? double(grid.dims[std::size_t(i)] - 1) : 0;
    const glm::dvec3 place = origin_of(grid) + axes * at;
    low = glm::min(low, place);
    high = glm::max(high, place);
  }
  return {{low.x, low.y, low.z}, {high.x, high.y, high.z}};
}

/// [least, largest] voxel, about: without a chunk that is not there.
std::array<float, 2> range_of(const Opened &on) {
  const std::array<float, 2> range = on.volume->value_range();
  if (!on.in_memory.chunks || (std::isfinite(range[0]) && std::isfinite(range[1])))
    return range_or_sampled(*on.volume);
  const core::MacrocellRanges &ranges = on.in_memory.chunks->ranges();
  return {std::ranges::min(ranges.low), std::ranges::max(ranges.high)};
}

const char *type_of(const Volume &volume) {
  constexpr std::array kTypes = {"uint8", "int8",    "uint16",  "int16",  "uint32",
                                 "int32", "float32", "float64", "uint64", "int64"};
  return kTypes.at(std::size_t(volume.source_type()));
}

json facts() {
  const Volume &volume = *opened->volume;
  const Grid &grid = volume.grid();
  json of_field;
  if (const auto &field = opened->field)
    of_field = {{"range", range_or_sampled(*field)}, {"dtype", type_of(*field)}};
  return {{"shape", {grid.dims[2], grid.dims[1], grid.dims[0]}},
          {"spacing", {grid.spacing[2], grid.spacing[1], grid.spacing[0]}},
          {"box", box_of(grid)},
          {"anatomical", grid.is_anatomical},
          {"dtype", type_of(volume)},
          {"range", range_of(*opened)},
          {"levels", opened->in_memory.coarser_levels.size() + 1},
          {"second", of_field},
          {"bits_per_voxel", volume.bits_per_voxel()},
          {"max_error", volume.max_voxel_error() ? json(*volume.max_voxel_error()) : json()},
          {"nbytes", volume.compressed_bytes()},
          {"memory", opened->renderer->memory_bytes()}};
}

json open(const json &request) {
  const std::string path = request.at("path");
  const auto found = request.find("chunks");
  auto volume =
      found == request.end()
          ? open_volume(path)
          : std::make_shared<const Volume>(std::make_unique<const Volume::Implementation>(
                core::read_chunks_head(read_file(path), *found), std::vector<std::string>{}));
  const std::string of_field = request.value("field", "");
  auto next = std::make_unique<Opened>(  // or throws, and the one before stays
      std::move(volume), of_field.empty() ? nullptr : open_volume(of_field));
  if (request.value("keep", false))
    core::give_zfp_file(next->volume->implementation().volume, "volume.zfp",
                        [](std::span<const std::byte> piece) {
                          const auto *begin = reinterpret_cast<const std::uint8_t *>(piece.data());
                          bytes.insert(bytes.end(), begin, begin + piece.size());
                        });
  opened = std::move(next);
  return facts();
}

Opened &the_volume() {
  if (!opened) throw core::Error("no volume is open");
  return *opened;
}

json supply(const json &request) {
  const std::vector<std::byte> all = read_file(request.at("path"));
  std::span<const std::byte> left(all);
  for (const json &part : request.at("parts")) {
    const std::uint64_t begin = part.at(0), size = part.at(1).get<std::uint64_t>() - begin;
    if (size > left.size()) throw core::Error("a part of the volume's file is too short");
    for (core::BlockChunks *of_level : the_volume().chunks()) {
      if (of_level->has_chunk_at(begin)) of_level->give(begin, left.first(size));
    }
    left = left.subspan(size);
  }
  return json::object();
}

ImageSize size_of_request(const json &request) {
  const auto &size = request.at("size");
  return {size.at(0), size.at(1), request.value("samples", 1u)};
}

json camera(const json &request) {
  const Scene scene = parse_scene(request.at("scene").dump());
  const Camera camera = the_volume().renderer->camera(scene.surfaces, size_of_request(request));
  return {{"camera",
           {{"eye", camera.eye},
            {"at", camera.at},
            {"up", camera.up},
            {"fovy_deg", camera.fovy_degrees}}}};
}

FrameRequest frame_request(const json &request) {
  const Scene scene = parse_scene(request.at("scene").dump());
  FrameRequest frame = scene_request(scene);
  frame.size = size_of_request(request);
  frame.ambient_rays = request.value("ambient", 0u);
  const bool has_labels = std::ranges::any_of(
      scene.surfaces, [](const Surface &surface) { return !surface.labels.empty(); });
  if (the_volume().in_memory.chunks && !has_labels)
    frame.voxel_pixels = request.value("voxel_pixels", 0.0);
  if (!scene.camera) frame.camera = the_volume().renderer->camera(scene.surfaces, frame.size);
  return frame;
}

/// The values of a group's fields, in order.
json values_of(const AnnotationGroup &group) {
  json boxes = json::array(), strokes = json::array(), texts = json::array();
  for (const auto &[begin, end, color] : group.boxes)
    boxes.push_back(json::array({begin, end, color}));
  for (const auto &[points, width, color] : group.strokes)
    strokes.push_back(json::array({points, width, color}));
  for (const auto &[place, anchor, size, text, color] : group.texts)
    texts.push_back(json::array({place, anchor, size, text, color}));
  return json::array({group.begin, group.end, boxes, strokes, texts, group.halo, group.halo_color});
}

/// The annotations of a request's scene, as JSON. None: the picture is too small.
std::string annotations_of(const json &request, FrameRequest frame,
                           const FrameStatistics &statistics) {
  const std::optional<Annotations> wanted = parse_scene(request.at("scene").dump()).annotations;
  const auto &size = request.at("annotated");
  frame.size = {size.at(0), size.at(1), 1};
  json groups = json::array();
  if (wanted && has_room_for_annotations(frame.size)) {
    for (const AnnotationGroup &group :
         annotation_layout(*wanted, frame, statistics.color_range, statistics.slice_range))
      groups.push_back(values_of(group));
  }
  return groups.dump();
}

/// Draws what is not finished of a request. Returns nothing if chunks are missing.
std::optional<Frame> render_or_wait(Opened &on, std::string request, const FrameRequest &wanted) {
  const bool goes_on = request == on.waiting;
  if (!goes_on) {
    on.hits = on.decoded_blocks = on.rays_cut = 0;
    for (core::BlockChunks *of_level : on.chunks()) of_level->drop_unused(kChunkBytes);
  }
  on.waiting.clear();
  on.host->go_on(goes_on);
  Frame frame = on.renderer->render(wanted);
  on.hits += frame.statistics.hits;
  on.decoded_blocks += frame.statistics.decoded_blocks;
  on.rays_cut += frame.statistics.rays_cut;
  if (!frame.statistics.cancelled) return frame;
  on.waiting = std::move(request);
  return {};
}

json draw(const json &request) {
  Opened &on = the_volume();
  const FrameRequest wanted = frame_request(request);
  std::array<std::uint32_t, 2> rows{0, wanted.size.height};
  if (const auto found = request.find("rows"); found != request.end()) rows = *found;
  on.host->set_rows(rows[0], rows[1]);
  const std::optional<Frame> drawn = render_or_wait(on, request.dump(), wanted);
  if (!drawn) return {};
  const Frame &frame = *drawn;
  const std::size_t pixels = std::size_t{wanted.size.width} * (rows[1] - rows[0]),
                    channels = wanted.appearance.transparent ? 4 : 3;
  bytes.resize(4 * pixels);
  const std::uint8_t *from =
      frame.picture.data() + channels * std::size_t{wanted.size.width} * rows[0];
  for (std::uint8_t *to = bytes.data(); to != bytes.data() + bytes.size(); to += 4) {
    std::copy_n(from, channels, to);
    if (channels == 3) to[3] = 255;
    from += channels;
  }
  const FrameStatistics &statistics = frame.statistics;
  std::string notice;
  for (const Surface &surface : scene_of(wanted).surfaces) {
    if (!surface.labels.empty()) continue;
    const std::string text = on.volume->isovalue_notice(surface.isovalue);
    if (!text.empty()) notice += (notice.empty() ? "" : " ") + text;
  }
  json answer = {{"hits", on.hits},
                 {"decoded_blocks", on.decoded_blocks},
                 {"rays_cut", on.rays_cut},
                 {"ms", statistics.total_ms},
                 {"notice", notice}};
  if (statistics.field_range) answer["field_range"] = *statistics.field_range;
  if (request.contains("annotated"))
    answer["annotations"] = annotations_of(request, wanted, statistics);
  return answer;
}

/// The trilinear value at a world position; nothing outside, or without data.
std::optional<double> value_at(const Volume &volume, const Vector3 &position) {
  const Grid &grid = volume.grid();
  const glm::dvec3 place(position[0], position[1], position[2]);
  glm::dvec3 index = glm::inverse(axes_of(grid)) * (place - origin_of(grid));
  Region region;
  glm::dvec3 part(0);
  for (int i = 0; i < 3; ++i) {
    const double last = grid.dims[std::size_t(i)] - 1;
    if (!(index[i] > -0.5 && index[i] < last + 0.5)) return {};
    index[i] = std::clamp(index[i], 0.0, last);
    const double begin = std::min(std::floor(index[i]), last - 1);
    part[i] = index[i] - begin;
    region.begin[std::size_t(i)] = static_cast<std::uint32_t>(begin);
    region.end[std::size_t(i)] = static_cast<std::uint32_t>(begin) + 2;
  }
  std::vector<float> cell(8);
  core::decode_region(volume.implementation().volume,
                      {{region.begin[0], region.begin[1], region.begin[2]},
                       {region.end[0], region.end[1], region.end[2]},
                       glm::uvec3(1)},
                      cell);
  double value = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    double weight = 1;
    for (int i = 0; i < 3; ++i) weight *= (corner >> i & 1u) != 0 ? part[i] : 1 - part[i];
    if (weight != 0) value += weight * double{cell[corner]};
  }
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

/// A picture of one pixel, whose ray is that of the pixel at that place.
json probe(const json &request) {
  Opened &on = the_volume();
  FrameRequest frame = frame_request(request);
  const ImageSize size = frame.size;
  const auto pixel = [](double at, std::uint32_t count) {
    return std::min(std::floor(at * count), count - 1.0) + 0.5;
  };
  Camera &camera = frame.camera;
  const auto vector = [](const Vector3 &v) { return glm::dvec3(v[0], v[1], v[2]); };
  const glm::dvec3 eye = vector(camera.eye), forward = glm::normalize(vector(camera.at) - eye),
                   right = glm::normalize(glm::cross(forward, vector(camera.up)));
  const double half = camera.parallel_height ? *camera.parallel_height / 2
                                             : core::tangent(glm::radians(camera.fovy_degrees) / 2),
               u = (2 * pixel(request.at("at").at(0), size.width) / size.width - 1) * half *
                   size.width / size.height,
               v = (1 - 2 * pixel(request.at("at").at(1), size.height) / size.height) * half;
  const glm::dvec3 aside = u * right + v * glm::cross(right, forward),
                   from = camera.parallel_height ? eye + aside : eye,
                   at = from + (camera.parallel_height ? forward : glm::normalize(forward + aside));
  camera.eye = {from.x, from.y, from.z};
  camera.at = {at.x, at.y, at.z};
  camera.fovy_degrees = 0.01;
  frame.size = {1, 1, 1};
  frame.ambient_rays = frame.appearance.shadow_rays = frame.appearance.bounce_rays = 0;
  frame.want_positions = true;
  on.host->set_rows(0, 1);
  on.host->go_on(false);
  on.waiting.clear();
  const Frame drawn = on.renderer->render(frame);
  if (drawn.statistics.cancelled) return {};
  const Vector3 position = drawn.positions[0];
  if (!std::isfinite(position[0]))
    return {{"position", nullptr}, {"value", nullptr}, {"field", nullptr}};
  const auto value_in = [&](const Volume *of) {
    const std::optional<double> value = of == nullptr ? std::nullopt : value_at(*of, position);
    return value ? json(*value) : json();
  };
  return {{"position", position},
          {"value", value_in(on.volume.get())},
          {"field", value_in(on.field.get())}};
}

json histogram() {
  const VoxelHistogram values = voxel_histogram(*the_volume().volume);
  return {{"counts", values.counts}, {"range", values.range}, {"suggested", values.suggested}};
}

json answer_to(const json &request) {
  const std::string what = request.at("what");
  if (what == "open") return open(request);
  if (what == "scene")
    return {
        {"fields", json::parse(scene_text(parse_scene(request.at("text").get<std::string>())))}};
  if (what == "camera") return camera(request);
  if (what == "draw") return draw(request);
  if (what == "probe") return probe(request);
  if (what == "histogram") return histogram();
  if (what == "supply") return supply(request);
  throw core::Error("the engine cannot \"{}\"", what);
}

/// An answer, or the parts of the volume's file that it needs.
json answer_or_missing(const json &request) {
  json answer;
  try {
    answer = answer_to(request);
  } catch (const core::ChunkIsMissing &) {
  }
  if (!opened) return answer;
  if (json missing = opened->take_missing(); !missing.empty()) return {{"missing", missing}};
  return answer;
}

}  // namespace

extern "C" {

/// Returns  the answer, until the next call
EMSCRIPTEN_KEEPALIVE const char *engine_call(const char *request) {
  static std::string answer;
  bytes.clear();
  try {
    answer = core::guarded("drawing", [&] {
               return answer_or_missing(json::parse(request));
             }).dump(-1, ' ', false, json::error_handler_t::replace);
  } catch (const std::exception &error) {
    answer = json{{"error", error.what()}}.dump(-1, ' ', false, json::error_handler_t::replace);
  }
  return answer.c_str();
}

/// The bytes of the last answer.
EMSCRIPTEN_KEEPALIVE const std::uint8_t *engine_bytes() {
  return bytes.data();
}
EMSCRIPTEN_KEEPALIVE std::size_t engine_num_bytes() {
  return bytes.size();
}

}  // extern "C"

}  // namespace isowave
