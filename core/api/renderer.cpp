#include "isowave/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "core/accuracy/certify.hpp"
#include "core/accuracy/choose_detail.hpp"
#include "core/api/convert.hpp"
#include "core/api/device_implementation.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/base/parallel_for.hpp"
#include "core/render/renderer.hpp"
#include "core/render/time_budget.hpp"
#include "core/view/detail.hpp"

namespace isowave {

namespace {

using core::guarded;

core::ImageSize core_size(const ImageSize &size) {
  return {size.width, size.height, size.samples};
}

core::RendererOptions core_options(const RendererOptions &options, const Volume &volume) {
  core::RendererOptions result;
  result.size = core_size(options.largest);
  result.memory_budget = options.memory_budget;
  result.cache_slots = options.cache_blocks;
  result.with_levels = options.with_levels && volume.num_levels() > 1;
  result.with_bounds = options.with_bounds;
  result.with_kept_picture = options.with_time_budget;
  return result;
}

core::Appearance core_appearance(const Appearance &appearance) {
  return {to_glm(appearance.surface), to_glm(appearance.background), appearance.ambient,
          appearance.diffuse, appearance.specular};
}

core::FrameRequest core_request(const FrameRequest &request) {
  core::FrameRequest result;
  const Camera &camera = request.camera;
  result.camera = {to_glm(camera.eye), to_glm(camera.at), to_glm(camera.up), camera.fovy_degrees};
  result.isovalue = request.isovalue;
  result.size = core_size(request.size);
  result.voxel_pixels = request.voxel_pixels;
  result.voxel_error = request.voxel_error;
  result.bound = static_cast<core::FieldBound>(request.bound);
  return result;
}

FrameStatistics public_statistics(const core::FrameStats &stats, std::uint64_t num_rays) {
  FrameStatistics result;
  result.passes = static_cast<std::uint32_t>(stats.passes.size());
  result.rays = num_rays;
  result.hits = stats.rays_hit;
  for (const core::PassStats &pass : stats.passes) {
    result.decoded_blocks += pass.counts.decoded_count;
    for (const auto &[stage, ms] : pass.stage_ms) result.stage_ms[stage] += ms;
  }
  result.uploaded_bytes = stats.uploaded_bytes;
  result.first_level = static_cast<std::uint32_t>(stats.first_level);
  result.last_level = static_cast<std::uint32_t>(stats.last_level);
  result.total_ms = stats.total_ms;
  result.cancelled = stats.cancelled;
  result.complete = !stats.cancelled;
  return result;
}

/// Finds the level of detail that a block id belongs to, and its place there.
class HitCells {
 public:
  HitCells(const core::CompressedVolume &volume, bool with_levels)
      : grids_(core::make_level_grids(core::level_infos(volume, with_levels))) {}

  Hit operator()(const core::HitRecord &record) const {
    Hit hit;
    hit.t = record.t;
    if (std::isinf(record.t)) return hit;
    const std::uint32_t columns = grids_[0].place.blocks_x, rows = grids_[0].place.blocks_y;
    const std::uint32_t layer = record.block_id / columns / rows;
    while (hit.level + 1 < grids_.size() && grids_[hit.level + 1].place.begin_z <= layer)
      ++hit.level;
    hit.cell = {4 * (record.block_id % columns) + record.cell % 4,
                4 * (record.block_id / columns % rows) + record.cell / 4 % 4,
                4 * (layer - grids_[hit.level].place.begin_z) + record.cell / 16};
    hit.position = {record.x, record.y, record.z};
    hit.gradient = {record.grad_x, record.grad_y, record.grad_z};
    return hit;
  }

 private:
  std::vector<core::FrameParams> grids_;
};

/// Where hits are.
class WorldPositions {
 public:
  WorldPositions(const core::CompressedVolume &volume, bool with_levels)
      : cells_(volume, with_levels), infos_(core::level_infos(volume, with_levels)) {}

  std::array<float, 3> operator()(const core::HitRecord &record) const {
    if (std::isinf(record.t)) {
      constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
      return {kNone, kNone, kNone};
    }
    const Hit hit = cells_(record);
    const core::VolumeInfo &info = infos_[hit.level];
    const glm::dvec3 index = glm::dvec3(hit.cell[0], hit.cell[1], hit.cell[2]) +
                             glm::dvec3(hit.position[0], hit.position[1], hit.position[2]);
    const glm::vec3 world(info.origin + info.index_to_world() * index);
    return {world.x, world.y, world.z};
  }

 private:
  HitCells cells_;
  std::vector<core::VolumeInfo> infos_;
};

/// Away from larger values, of length 1.
class WorldNormals {
 public:
  explicit WorldNormals(const core::VolumeInfo &info)
      : to_world_(glm::transpose(glm::inverse(info.index_to_world()))) {}

  std::array<float, 3> operator()(const core::HitRecord &hit) const {
    glm::dvec3 gradient(hit.grad_x, hit.grad_y, hit.grad_z);
    const double largest =
        std::max({std::abs(gradient.x), std::abs(gradient.y), std::abs(gradient.z)});
    if (std::isinf(hit.t) || largest == 0) return {};
    gradient = to_world_ * (gradient / largest);
    const glm::vec3 normal(-gradient / glm::length(gradient));
    return {normal.x, normal.y, normal.z};
  }

 private:
  glm::dmat3 to_world_;
};

}  // namespace

struct Renderer::Implementation {
  Implementation(std::shared_ptr<Device> device_used, std::shared_ptr<const Volume> volume_drawn,
                 const RendererOptions &renderer_options)
      : device(std::move(device_used)),
        volume(std::move(volume_drawn)),
        options(renderer_options),
        renderer(device->implementation().device, volume->implementation().volume,
                 core_options(options, *volume)) {
    if (options.with_time_budget) timed.emplace(renderer);
  }

  Frame draw(const FrameRequest &request);
  core::FrameStats draw_hits(const FrameRequest &request, core::FrameRequest &wanted, Frame &frame);
  void fetch(const FrameRequest &request, const core::FrameRequest &drawn, Frame &frame);

  std::shared_ptr<Device> device;
  std::shared_ptr<const Volume> volume;
  RendererOptions options;
  core::Renderer renderer;
  std::optional<core::TimedFrames> timed;
};

namespace {

/// The frame at work, for on_pass.
class ProgressOf : public Progress {
 public:
  ProgressOf(core::Renderer &renderer, const core::Appearance &appearance)
      : renderer_(renderer), appearance_(appearance) {}

  void end_pass(const core::PassStats &pass) {
    ++passes_;
    completed_percent_ = pass.completed_percent;
  }
  std::uint32_t passes() const override { return passes_; }
  double completed_percent() const override { return completed_percent_; }
  std::vector<std::uint8_t> picture() const override { return renderer_.shade(appearance_).pixels; }

 private:
  core::Renderer &renderer_;
  core::Appearance appearance_;
  std::uint32_t passes_ = 0;
  double completed_percent_ = 0;
};

void check(const FrameRequest &request, const RendererOptions &options) {
  const bool sets_detail = request.voxel_pixels != 0 || request.voxel_error != 0;
  if (request.max_surface_error && sets_detail)
    throw core::Error(
        "max_surface_error chooses the detail: leave out voxel_pixels and voxel_error");
  if (request.max_surface_error && request.time_budget_ms)
    throw core::Error("a frame cannot keep both an error and a time: give one of the two");
  if ((request.max_surface_error || request.want_bounds) && request.bound != FieldBound::kNone)
    throw core::Error("the surface of a bound has no error: draw the volume itself");
  if ((request.max_surface_error || request.want_bounds) && !options.with_bounds)
    throw core::Error("bounds of the error need a renderer that was made with_bounds");
  if (request.time_budget_ms && !options.with_time_budget)
    throw core::Error("a time budget needs a renderer that was made with_time_budget");
  if (request.time_budget_ms && request.want_bounds)
    throw core::Error("a picture within a time has no bounds of its error: leave out want_bounds");
  if (request.time_budget_ms && request.on_pass)
    throw core::Error("a frame with a time budget does not show its passes: leave out on_pass");
}

}  // namespace

/// Chooses the detail, or keeps to the time, where the request says so, and draws. wanted: becomes
/// the request as it was drawn.
core::FrameStats Renderer::Implementation::draw_hits(const FrameRequest &request,
                                                     core::FrameRequest &wanted, Frame &frame) {
  if (request.time_budget_ms) {
    const core::TimedFrame drawn = timed.value().render(wanted, *request.time_budget_ms);
    core::FrameStats stats = drawn.stats;
    stats.cancelled = !drawn.complete;
    return stats;
  }
  if (request.max_surface_error) {
    const core::DetailChoice choice = core::choose_detail(renderer, volume->implementation().volume,
                                                          wanted, *request.max_surface_error);
    wanted.voxel_pixels = choice.detail.voxel_pixels;
    wanted.voxel_error = choice.detail.voxel_error;
    frame.detail =
        DetailChoice{wanted.voxel_pixels, wanted.voxel_error, choice.reachable, choice.advice};
  }
  ProgressOf progress(renderer, core_appearance(request.appearance));
  if (request.on_pass) {
    wanted.on_pass = [&](const core::PassStats &pass) {
      progress.end_pass(pass);
      return request.on_pass(progress);
    };
  }
  core::FrameStats stats = renderer.render(wanted);
  wanted.on_pass = {};
  return stats;
}

/// What the request wants of the frame that was drawn.
void Renderer::Implementation::fetch(const FrameRequest &request, const core::FrameRequest &drawn,
                                     Frame &frame) {
  const core::CompressedVolume &compressed = volume->implementation().volume;
  if (request.want_picture)
    frame.picture = renderer.shade(core_appearance(request.appearance)).pixels;
  if (!(request.want_depth || request.want_normals || request.want_positions || request.want_hits ||
        request.want_bounds))
    return;
  const bool with_levels = renderer.options().with_levels;
  const std::vector<core::HitRecord> records = renderer.hits();
  const auto to_each = [&](auto &out, const auto &make) {
    out.resize(records.size());
    core::parallel_for(records.size(), 0,
                       [&](std::uint64_t i, std::uint32_t) { out[i] = make(records[i]); });
  };
  if (request.want_depth) frame.depth = core::depth_of(records);
  if (request.want_normals) to_each(frame.normals, WorldNormals(compressed.info));
  if (request.want_positions) to_each(frame.positions, WorldPositions(compressed, with_levels));
  if (request.want_hits) to_each(frame.hits, HitCells(compressed, with_levels));
  if (request.want_bounds)
    frame.bounds = core::certify(renderer, compressed, drawn, records).bounds;
}

Frame Renderer::Implementation::draw(const FrameRequest &request) {
  check(request, options);
  core::FrameRequest wanted = core_request(request);
  Frame frame;
  const core::FrameStats stats = draw_hits(request, wanted, frame);
  frame.size = request.size;
  const core::ImageSize size = core_size(request.size);
  frame.rows = size.ray_rows();
  frame.columns = size.ray_columns();
  frame.statistics = public_statistics(stats, size.num_rays());
  fetch(request, wanted, frame);
  return frame;
}

Renderer::Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                   const RendererOptions &options) {
  guarded("making a renderer", [&] {
    if (!device || !volume) throw core::Error("a renderer needs a device and a volume");
    const std::lock_guard lock(device->implementation().mutex);
    implementation_ = std::make_unique<Implementation>(device, std::move(volume), options);
  });
}

Renderer::~Renderer() {
  release();
}
Renderer::Renderer(Renderer &&) noexcept = default;
Renderer &Renderer::operator=(Renderer &&other) noexcept {
  release();
  implementation_ = std::move(other.implementation_);
  return *this;
}

/// Buffers go while no other thread drives the device, which must outlive the lock.
void Renderer::release() noexcept {
  if (!implementation_) return;
  const std::shared_ptr<Device> device = implementation_->device;
  const std::lock_guard lock(device->implementation().mutex);
  implementation_.reset();
}

Frame Renderer::render(const FrameRequest &request) {
  return guarded("rendering", [&] {
    const std::lock_guard lock(implementation_->device->implementation().mutex);
    return implementation_->draw(request);
  });
}

Camera Renderer::camera(float isovalue, std::optional<ImageSize> size) {
  return guarded("looking for the surface", [&] {
    const std::lock_guard lock(implementation_->device->implementation().mutex);
    const core::Camera camera = implementation_->renderer.camera(
        {&isovalue, 1}, size ? std::optional(core_size(*size)) : std::nullopt);
    return Camera{from_glm(camera.eye), from_glm(camera.at), from_glm(camera.up), camera.fovy_deg};
  });
}

const std::shared_ptr<Device> &Renderer::device() const {
  return implementation_->device;
}
const std::shared_ptr<const Volume> &Renderer::volume() const {
  return implementation_->volume;
}
std::uint64_t Renderer::memory_bytes() const {
  return implementation_->renderer.memory_plan().total();
}
double Renderer::setup_ms() const {
  return implementation_->renderer.setup_ms();
}

void save_png(const Frame &frame, const std::filesystem::path &path) {
  guarded("saving a picture", [&] {
    if (frame.picture.empty()) throw core::Error("{}: the frame has no picture", path.string());
    core::write_png({frame.size.width, frame.size.height, 3, frame.picture}, path);
  });
}

std::vector<std::uint8_t> encode_png(const Frame &frame) {
  return guarded("encoding a picture", [&] {
    if (frame.picture.empty()) throw core::Error("the frame has no picture");
    return core::encode_png({frame.size.width, frame.size.height, 3, frame.picture});
  });
}

}  // namespace isowave
