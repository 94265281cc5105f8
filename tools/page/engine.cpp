// The engine of a page: opens volumes and draws scenes of them, in a worker of a browser. Each
// worker has an engine of its own, and draws some rows of each picture.
//
// engine_call() takes a request, JSON, and returns its answer, JSON: {"error": "..."}, or what the
// request's "what" gives:
//
//   open    path, keep: keep the .zfp file's bytes -> facts of the volume, as the viewer's
//   "welcome"
//           has them; bytes of a .zfp file if it was none
//   scene   text -> fields: the scene's, without those that have their defaults
//   camera  scene, size [width, height] -> camera, which the surfaces fill
//   draw    scene, size, samples, ambient, rows [begin, end]; png -> what was drawn; bytes: RGBA of
//           these rows, or a PNG file of the whole picture
//   probe   scene, size, at [x, y], 0 to 1 -> position, value: what is seen there, or null
//   histogram  bins -> counts, range, suggested isovalues

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
#include "core/host/host_renderer.hpp"
#include "core/zfp/zfp_file.hpp"
#include "isowave/host.hpp"
#include "isowave/scene.hpp"

namespace isowave {

namespace {

using nlohmann::json;

/// Voxels that the histogram is made of, about.
constexpr std::uint64_t kSampledVoxels = 1u << 21;

/// A volume, and what draws it.
struct Opened {
  explicit Opened(const std::string &path) : volume(open_volume(path)) {
    in_memory = volume->implementation().volume;
    in_memory.coarser_levels.clear();  // the finest draws all
    if (in_memory.file) {
      in_memory.words.resize(in_memory.word_count());
      in_memory.read_words(0, in_memory.words);
      in_memory.file.reset();
      in_memory.file_first_bit = 0;
    }
    auto on_host = std::make_unique<core::HostRenderer>(
        in_memory, core::HostRendererOptions{.num_threads = 1, .field = &in_memory});
    host = on_host.get();
    auto implementation = std::make_unique<Renderer::Implementation>(std::make_shared<Turns>(),
                                                                     volume, std::move(on_host));
    implementation->field = volume;
    renderer.emplace(std::move(implementation));
  }
  Opened(const Opened &) = delete;
  Opened &operator=(const Opened &) = delete;

  std::shared_ptr<const Volume> volume;
  core::CompressedVolume in_memory;  ///< which rays read from
  core::HostRenderer *host = nullptr;
  std::optional<Renderer> renderer;
};

std::unique_ptr<Opened> opened;
std::vector<std::uint8_t> bytes;

/// [least, largest] voxel, or if the file does not say, that of a sample.
std::array<float, 2> range_of(const Volume &volume) {
  std::array<float, 2> range = volume.value_range();
  if (std::isfinite(range[0]) && std::isfinite(range[1])) return range;
  range = {std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  for (const float voxel : volume.sample(kSampledVoxels)) {
    if (!std::isfinite(voxel)) continue;
    range = {std::min(range[0], voxel), std::max(range[1], voxel)};
  }
  return range[0] <= range[1] ? range : std::array{0.0f, 0.0f};
}

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

json facts() {
  constexpr std::array kTypes = {"uint8", "int8",    "uint16",  "int16",  "uint32",
                                 "int32", "float32", "float64", "uint64", "int64"};
  const Volume &volume = *opened->volume;
  const Grid &grid = volume.grid();
  return {{"shape", {grid.dims[2], grid.dims[1], grid.dims[0]}},
          {"spacing", {grid.spacing[2], grid.spacing[1], grid.spacing[0]}},
          {"box", box_of(grid)},
          {"anatomical", grid.is_anatomical},
          {"dtype", kTypes.at(std::size_t(volume.source_type()))},
          {"range", range_of(volume)},
          {"bits_per_voxel", volume.bits_per_voxel()},
          {"max_error", volume.max_voxel_error() ? json(*volume.max_voxel_error()) : json()},
          {"nbytes", volume.compressed_bytes()},
          {"memory", opened->renderer->memory_bytes()}};
}

json open(const json &request) {
  const std::string path = request.at("path");
  auto next = std::make_unique<Opened>(path);  // or throws, and the volume before stays
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
  if (!scene.camera) frame.camera = the_volume().renderer->camera(scene.surfaces, frame.size);
  return frame;
}

json draw(const json &request) {
  Opened &on = the_volume();
  const FrameRequest wanted = frame_request(request);
  const bool as_png = request.value("png", false);
  std::array<std::uint32_t, 2> rows{0, wanted.size.height};
  if (const auto found = request.find("rows"); found != request.end() && !as_png) rows = *found;
  on.host->set_rows(rows[0], rows[1]);
  const Frame frame = on.renderer->render(wanted);
  if (as_png) {
    bytes = encode_png(frame);
  } else {
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
  }
  const FrameStatistics &statistics = frame.statistics;
  std::string notice;
  for (const Surface &surface : scene_of(wanted).surfaces) {
    if (!surface.labels.empty()) continue;
    const std::string text = on.volume->isovalue_notice(surface.isovalue);
    if (!text.empty()) notice += (notice.empty() ? "" : " ") + text;
  }
  json answer = {{"hits", statistics.hits},
                 {"decoded_blocks", statistics.decoded_blocks},
                 {"rays_cut", statistics.rays_cut},
                 {"ms", statistics.total_ms},
                 {"notice", notice}};
  if (statistics.field_range) answer["field_range"] = *statistics.field_range;
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
  const std::vector<float> cell = volume.decode(0, region);
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
  const Camera &camera = frame.camera;
  const auto vector = [](const Vector3 &v) { return glm::dvec3(v[0], v[1], v[2]); };
  const glm::dvec3 eye = vector(camera.eye), forward = glm::normalize(vector(camera.at) - eye),
                   right = glm::normalize(glm::cross(forward, vector(camera.up)));
  const double half = std::tan(glm::radians(camera.fovy_degrees) / 2),
               u = (2 * pixel(request.at("at").at(0), size.width) / size.width - 1) * half *
                   size.width / size.height,
               v = (1 - 2 * pixel(request.at("at").at(1), size.height) / size.height) * half;
  const glm::dvec3 ray = glm::normalize(forward + u * right + v * glm::cross(right, forward)),
                   at = eye + ray;
  frame.camera.at = {at.x, at.y, at.z};
  frame.camera.fovy_degrees = 0.01;
  frame.size = {1, 1, 1};
  frame.ambient_rays = frame.appearance.shadow_rays = frame.appearance.bounce_rays = 0;
  frame.want_positions = true;
  on.host->set_rows(0, 1);
  const Frame drawn = on.renderer->render(frame);
  const Vector3 position = drawn.positions[0];
  if (!std::isfinite(position[0])) return {{"position", nullptr}, {"value", nullptr}};
  const std::optional<double> value = value_at(*on.volume, position);
  return {{"position", position}, {"value", value ? json(*value) : json()}};
}

json histogram(const json &request) {
  const Volume &volume = *the_volume().volume;
  const std::size_t bins = request.at("bins");
  const std::array<float, 2> range = range_of(volume);
  std::vector<std::uint64_t> counts(bins);
  const double width = range[1] > range[0] ? double{range[1]} - double{range[0]} : 1;
  for (const float voxel : volume.sample(kSampledVoxels)) {
    const double bin = std::floor((double{voxel} - range[0]) * double(bins) / width);
    if (std::isfinite(bin))
      ++counts[static_cast<std::size_t>(std::clamp(bin, 0.0, double(bins - 1)))];
  }
  return {{"counts", counts}, {"range", range}, {"suggested", volume.suggested_isovalues()}};
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
  if (what == "histogram") return histogram(request);
  throw core::Error("the engine cannot \"{}\"", what);
}

}  // namespace

extern "C" {

/// Returns  the answer, until the next call
EMSCRIPTEN_KEEPALIVE const char *engine_call(const char *request) {
  static std::string answer;
  bytes.clear();
  try {
    answer = core::guarded("drawing", [&] {
               return answer_to(json::parse(request));
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
