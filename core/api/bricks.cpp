#include "isowave/bricks.hpp"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/api/device_implementation.hpp"
#include "core/api/device_renderer.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/bricks/ranks.hpp"
#include "core/bricks/team_renderer.hpp"
#include "core/sources/noise_on_device.hpp"
#include "core/stages/zfp_encode.hpp"
#include "isowave/version.hpp"

namespace isowave {

namespace {

using core::guarded;

class ProcessTeam : public core::Team {
 public:
  explicit ProcessTeam(Processes &processes) : processes_(processes) {}
  std::uint32_t rank() const override { return processes_.rank(); }
  std::uint32_t size() const override { return processes_.size(); }
  std::uint32_t local_rank() const { return processes_.local_rank(); }
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

/// The objects that a team's renderer needs, in the order in which they are made.
struct TeamHeld {
  explicit TeamHeld(Processes &processes) : team(processes) {}

  ProcessTeam team;
  Turns turns;
  std::unique_ptr<Device::Implementation> device{};
  std::optional<core::TeamVolume> volume{};
  core::CompressedVolume field{};  ///< of a file of its own
  std::vector<std::string> notices{};
};

/// A text of the options in which all processes must agree.
std::string text_of(const BrickOptions &options, const core::Storage &storage) {
  const RendererOptions &renderer = options.renderer;
  return fmt::format(
      "{} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {}", renderer.largest.width,
      renderer.largest.height, renderer.largest.samples, renderer.with_levels, renderer.with_bounds,
      renderer.with_time_budget, renderer.with_rays, renderer.with_bounce, renderer.with_surfaces,
      renderer.with_labels, options.bricks, options.field.string(), storage.rate.value_or(0),
      storage.tolerance.value_or(0), storage.tolerance_relative.value_or(0), storage.exact,
      storage.levels, storage.map_nan.value_or(0),
      storage.no_data ? fmt::to_string(*storage.no_data) : "none");
}

/// How a file is stored if this process's device compresses it.
core::Storage storage_on(core::ocl::Device &device, const std::string &path,
                         const Compression &compression) {
  core::Storage storage = storage_for(path, compression);
  storage.encoder = core::encoder_on(device);
  storage.noise = core::noise_on(device);
  return storage;
}

/// Opens device and volume, at all processes.
void open(TeamHeld &held, const std::string &path, const Compression &compression,
          const RawFile &raw, const BrickOptions &options) {
  core::Team &team = held.team;
  core::agree_on(team, "version", std::string(version()));
  core::TeamVolumeSource source;
  source.path = path;
  source.bricks = options.bricks;
  core::together(team, [&] {
    if (options.renderer.field)
      throw core::Error("a team's field is a file: give BrickOptions::field");
    held.device = std::make_unique<Device::Implementation>(
        core::choose_local_device(options.device, held.team.local_rank()), DeviceOptions{});
    source.storage = storage_on(held.device->device, path, compression);
    source.storage.measure_error |= options.renderer.with_bounds;
    source.overrides = to_overrides(raw);
  });
  core::agree_on(team, "request", text_of(options, source.storage));
  held.volume = core::open_together(team, source, [&](std::vector<core::VolumeInfo> &levels) {
    if (!core::is_zfp_name(path))
      held.notices = core::open_any_volume(path, source.overrides)->notices();
    if (!options.renderer.with_levels) levels.resize(1);
    if (compression.levels != 1 || (options.renderer.with_levels && levels.size() == 1))
      throw core::Error("{}: bricks have levels of detail that are in a .zfp file: convert it",
                        path);
  });
  const std::string field = options.field.string();
  if (field.empty() || field == path) return;
  core::together(team, [&] {
    source.storage = storage_on(held.device->device, field,
                                core::is_zfp_name(field) ? Compression{} : compression);
  });
  source.path = field;
  source.overrides = {};
  held.field = core::open_field_together(team, source, *held.volume);
}

}  // namespace

Renderer make_team_renderer(Processes &processes, const std::filesystem::path &path,
                            const Compression &compression, const RawFile &raw,
                            const BrickOptions &options) {
  return guarded("making a renderer", [&] {
    const auto held = std::make_shared<TeamHeld>(processes);
    open(*held, path.string(), compression, raw, options);
    const core::TeamVolume &volume = held->volume.value();
    std::unique_ptr<core::Renderer> renderer;
    // Processes do not say which of them share a host: on CPUs all wait for the first.
    const bool is_on_cpu = held->device->device.info().type == core::ocl::DeviceType::kCpu;
    core::in_turns(held->team, !is_on_cpu || held->team.rank() == 0, [&] {
      core::RendererOptions of_core =
          core_options(options.renderer, static_cast<std::uint32_t>(volume.num_levels));
      if (!options.field.empty())
        of_core.field = options.field.string() == path.string() ? &volume.brick : &held->field;
      renderer = std::make_unique<core::TeamRenderer>(held->device->device, volume,
                                                      std::move(of_core), held->team);
    });
    auto result = std::make_unique<Renderer::Implementation>(
        std::shared_ptr<Turns>(held, &held->turns), volume.brick,
        add_choices(std::move(renderer), choices_of(options.renderer), volume.brick, volume.rate));
    result->device_info = held->device->info;
    result->grid = public_grid(volume.whole());
    result->notices = held->notices;
    return Renderer(std::move(result));
  });
}

}  // namespace isowave
