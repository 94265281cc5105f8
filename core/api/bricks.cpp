#include "isowave/bricks.hpp"

#include <fmt/format.h>

#include <utility>

#include "core/accuracy/bounded_frames.hpp"
#include "core/accuracy/certify.hpp"
#include "core/accuracy/choose_detail.hpp"
#include "core/api/device_implementation.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/bricks/brick_renderer.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/render/surface_camera.hpp"
#include "core/volume/range_thresholds.hpp"
#include "core/zfp/isovalue.hpp"
#include "isowave/version.hpp"

namespace isowave {

class ProcessTeam : public core::Team {
 public:
  explicit ProcessTeam(Processes &processes) : processes_(processes) {}
  std::uint32_t rank() const override { return processes_.rank(); }
  std::uint32_t size() const override { return processes_.size(); }
  std::vector<std::string> all_gather(const std::string &text) override {
    return processes_.all_gather(text);
  }
  void reduce(std::size_t count, core::Reduction how, core::Receiver who,
              const core::MakeWords &make, const core::TakeWords &take) override {
    const bool for_all = who == core::Receiver::kAll;
    core::reduce_in_pieces(count, for_all || rank() == 0, make, take,
                           [&](std::span<std::uint64_t> words) {
                             processes_.reduce(words, to_reduction(how), for_all);
                           });
  }

 private:
  static Processes::Reduction to_reduction(core::Reduction how) {
    switch (how) {
      case core::Reduction::kMin:
        return Processes::Reduction::kMin;
      case core::Reduction::kMinOfHalves:
        return Processes::Reduction::kMinOfHalves;
      case core::Reduction::kOr:
        break;
    }
    return Processes::Reduction::kOr;
  }

  Processes &processes_;
};

namespace {

using core::guarded;

core::RendererOptions core_options(const RendererOptions &options) {
  if (options.with_time_budget) throw core::Error("bricks have no time budget");
  core::RendererOptions result;
  result.size = core_size(options.largest);
  result.memory_budget = options.memory_budget;
  result.cache_slots = options.cache_blocks;
  result.with_bounds = options.with_bounds;
  result.with_given_rays = options.with_rays;
  return result;
}

std::string text_of(const ImageSize &size) {
  return fmt::format("{} {} {} ", size.width, size.height, size.samples);
}

/// What all processes must ask for alike.
std::string text_of(const FrameRequest &request) {
  const Camera &camera = request.camera;
  const Appearance &look = request.appearance;
  std::string text = text_of(request.size);
  for (const Vector3 &v : {camera.eye, camera.at, camera.up})
    text += fmt::format("{} {} {} ", v[0], v[1], v[2]);
  for (const std::array<float, 3> &c : {look.surface, look.background})
    text += fmt::format("{} {} {} ", c[0], c[1], c[2]);
  return text + fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {}",
                            camera.fovy_degrees, request.isovalue, look.ambient, look.diffuse,
                            look.specular, look.above, request.voxel_pixels, request.voxel_error,
                            request.max_surface_error.has_value(),
                            request.max_surface_error.value_or(0), static_cast<int>(request.bound),
                            static_cast<int>(request.normals), request.ambient_rays,
                            request.want_picture, request.want_depth, request.want_normals,
                            request.want_bounds);
}

void check_for_bricks(const FrameRequest &request, const RendererOptions &options) {
  if (request.want_positions || request.want_hits || request.time_budget_ms || request.on_pass)
    throw core::Error(
        "frames of bricks have picture, depth, normals and bounds: no positions, hits, time "
        "budget or on_pass");
  check_bounds(request, options);
  if (request.ambient_rays != 0 && !options.with_rays)
    throw core::Error("ambient rays need a renderer that was made with_rays");
}

}  // namespace

struct BrickRenderer::Implementation {
  Implementation(Processes &processes, const std::string &path, const Compression &compression,
                 const RawFile &raw, const BrickOptions &wanted);

  Frame draw(const FrameRequest &request);

  ProcessTeam team;
  Turns turns;
  RendererOptions options;
  std::unique_ptr<Device::Implementation> device{};
  Grid grid{};
  std::vector<std::string> notices{};
  std::optional<core::TeamVolume> volume{};
  std::optional<core::BrickRenderer> renderer{};
  std::optional<core::FramesOfTeam> bounded{};  ///< with bounds
};

BrickRenderer::Implementation::Implementation(Processes &processes, const std::string &path,
                                              const Compression &compression, const RawFile &raw,
                                              const BrickOptions &wanted)
    : team(processes), options(wanted.renderer) {
  core::agree_on(team, "version", std::string(version()));
  core::TeamVolumeSource source;
  source.path = path;
  source.bricks = wanted.bricks;
  core::Storage &storage = source.storage;
  core::RendererOptions of_core;
  core::together(team, [&] {
    storage = storage_for(path, compression);
    storage.measure_error |= options.with_bounds;
    source.overrides = to_overrides(raw);
    of_core = core_options(options);
    device = std::make_unique<Device::Implementation>(
        core::choose_local_device(wanted.device, processes.local_rank()), DeviceOptions{});
    storage.device = &device->device;
  });
  core::agree_on(team, "request",
                 fmt::format("{} {} {} {} {} {} {} {} {} {} {} {}", text_of(options.largest),
                             options.with_levels, options.with_bounds, options.with_rays,
                             wanted.bricks, storage.rate.value_or(0), storage.tolerance.value_or(0),
                             storage.relative_tolerance.value_or(0), storage.exact, storage.levels,
                             storage.map_nan.value_or(0),
                             storage.no_data ? fmt::to_string(*storage.no_data) : "none"));
  volume = core::open_together(team, source, [&](std::vector<core::VolumeInfo> &levels) {
    if (!core::is_zfp_name(path))
      notices = core::open_any_volume(path, source.overrides)->notices();
    if (!options.with_levels) levels.resize(1);
    if (compression.levels != 1 || (options.with_levels && levels.size() == 1))
      throw core::Error("{}: bricks have levels of detail that are in a .zfp file: convert it",
                        path);
  });
  grid = public_grid(volume->whole());
  core::together(team, [&] { renderer.emplace(device->device, *volume, of_core, team); });
  if (options.with_bounds) bounded.emplace(*renderer, volume->brick, volume->rate);
}

Frame BrickRenderer::Implementation::draw(const FrameRequest &request) {
  core::agree_on(team, "request", text_of(request));
  check_for_bricks(request, options);
  core::FrameRequest wanted = core_request(request, volume->brick);
  Frame frame;
  if (request.max_surface_error) {
    const core::DetailChoice choice =
        core::choose_detail(*bounded, wanted, *request.max_surface_error);
    wanted = core::with_detail(wanted, choice.detail);
    if (team.rank() == 0) frame.detail = public_choice(choice);
  }
  renderer->check_levels(wanted);
  describe_frame(request, renderer->render(wanted), frame);
  if (request.want_normals) {
    const std::vector<core::HitRecord> hits = renderer->hits();
    fill_frame(request, hits, volume->brick, false, frame);
  } else if (request.want_depth || !request.want_picture) {
    frame.depth = renderer->depth();
  }
  frame.statistics.hits = renderer->num_hits();
  frame.statistics.errors_are_stated = volume->brick.errors_are_stated;
  if (request.want_picture)
    frame.picture = renderer->shade(core_appearance(request.appearance)).pixels;
  if (!request.want_depth) frame.depth.clear();
  if (request.want_bounds) frame.bounds = core::certify(*bounded, wanted, renderer->depth()).bounds;
  return frame;
}

BrickRenderer::BrickRenderer(Processes &processes, const std::filesystem::path &path,
                             const Compression &compression, const RawFile &raw,
                             const BrickOptions &options) {
  guarded("making a renderer", [&] {
    implementation_ =
        std::make_unique<Implementation>(processes, path.string(), compression, raw, options);
  });
}

BrickRenderer::~BrickRenderer() = default;

Frame BrickRenderer::render(const FrameRequest &request) {
  return guarded("rendering", [&] {
    const std::lock_guard turn(implementation_->turns);
    return implementation_->draw(request);
  });
}

Camera BrickRenderer::camera(double isovalue, std::optional<ImageSize> size) {
  return guarded("looking for the surface", [&] {
    Implementation &self = *implementation_;
    const std::lock_guard turn(self.turns);
    std::optional<core::BlockBox> own;
    const float drawn = core::drawn_isovalue(self.volume->brick, isovalue);
    core::together(self.team, [&] { own = self.renderer->surface_box({&drawn, 1}); });
    return public_camera(core::surface_camera(
        self.volume->whole(), core::gather_box(self.team, self.volume->brick.info, own),
        core_size(size.value_or(self.options.largest))));
  });
}

const std::vector<std::string> &BrickRenderer::notices() const {
  return implementation_->notices;
}
std::string BrickRenderer::isovalue_notice(double isovalue) const {
  return guarded("looking at an isovalue",
                 [&] { return core::isovalue_notice(implementation_->volume->brick, isovalue); });
}

const Grid &BrickRenderer::grid() const {
  return implementation_->grid;
}
const DeviceInfo &BrickRenderer::device() const {
  return implementation_->device->info;
}

}  // namespace isowave
