#include "tools/isowave/render_drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "core/accuracy/image_error.hpp"
#include "core/api/choices.hpp"
#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/text.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/host/host_renderer.hpp"
#include "core/io/file_name.hpp"
#include "core/stages/march_packets.hpp"
#include "reference/twin_renderer.hpp"
#include "tools/isowave/device_choice.hpp"
#include "tools/isowave/mpi_team.hpp"
#include "tools/isowave/render_stats.hpp"

namespace isowave::core::tools {

std::unique_ptr<ocl::Device> open_device(const RenderArgs &options, bool is_team) {
  const ocl::DeviceInfo info = is_team ? choose_local_device(options.device, MpiJob::local_rank())
                                       : ocl::choose_device(options.device);
  return open_and_say(info, !options.stats.empty() && !options.no_stage_times);
}

void set_wanted(RenderArgs &options) {
  RendererOptions &wanted = options.renderer_flags.values;
  wanted.with_shading = asks_for_picture(options);
  wanted.with_kept_picture = options.time_budget.has_value();
  wanted.with_given_rays = options.ambient_rays != 0 || options.light.shadow_rays != 0;
  wanted.with_bounce = options.light.bounce_rays != 0;
  wanted.with_bounds = draws_bounds(options);
  wanted.max_surfaces = static_cast<std::uint32_t>(options.surfaces.size());
  wanted.with_labels = has_labels(options.surfaces);
  if (draws_layers(options)) wanted.max_surfaces = std::max(wanted.max_surfaces, 1u);
  options.frame.compression.measure_error |= wanted.with_bounds;
  if (!wanted.with_shading) options.normals = to_string(Normals::kCell);  // no picture shows them
}

void choose_drawing(const CLI::App &command, const RenderArgs &options, Drawing &drawing) {
  if (options.reference || drawing.is_team()) return;
  drawing.draws_on = choose_device_or_host(options.device, find_device_option(command));
}

namespace {

/// Whether a device must draw instead of the host, whose memory is not enough for the volume.
bool exceeds_host(const RenderArgs &options, const Drawing &drawing) {
  return drawing.draws_on == ocl::DrawsOn::kHostByDefault &&
         !HostRenderer::fits(drawing.whole, options.renderer_flags.values.memory_budget) &&
         !ocl::list_devices().empty();
}

/// Whether levels of detail are chosen among those that the volume has. Small pictures of a time
/// budget keep the finest level on CPUs: Abilities::levels_pay.
bool chooses_levels(const RenderArgs &options, const Drawing &drawing) {
  return chooses_levels(options) ||
         (options.time_budget && drawing.device && options.renderer_flags.pipeline != "blocks" &&
          !MarchPackets::suits(drawing.device->info()));
}

/// Whether the field is the volume itself, also by its file's name, unless that file is a
/// segmentation: surfaces of `volume` have their own labels. Options of the volume's grid are not
/// the field's.
bool is_field_drawn(const RenderArgs &options, const Drawing &drawing) {
  const std::string &field = options.color_map.field;
  if (field == "volume") return true;
  const VolumeOptions &grid = options.volume;
  std::error_code failure;
  const std::string &index = options.color_map.index;
  return !drawing.appearance.color_by_label && (index.empty() || index == grid.index) &&
         options.series.empty() && grid.dims.empty() && grid.type.empty() && grid.spacing.empty() &&
         std::filesystem::equivalent(field, options.input, failure);
}

bool has_levels_to_choose(const RenderArgs &options, const Drawing &drawing) {
  return chooses_levels(options, drawing) && !drawing.whole.coarser_levels.empty();
}

}  // namespace

void take_step(RenderArgs &options, Drawing &drawing, std::size_t index) {
  drawing.whole = drawing.series->open(index);
  drawing.series->prepare(index + 1);
  options.renderer_flags.values.with_levels = has_levels_to_choose(options, drawing);
}

namespace {

RawOverrides field_overrides(const RenderArgs &options) {
  RawOverrides overrides;
  overrides.step = parse_index("--field-index", options.color_map.index);
  return overrides;
}

}  // namespace

void load_alone(RenderArgs &options, Drawing &drawing) {
  if (options.voxel_pixels > 0 || chooses_levels(options, drawing))
    want_levels(options.frame.compression);
  // The field comes first: if it cannot be opened, the volume need not be compressed.
  const std::string &field = options.color_map.field;
  const bool has_other = options.color_map.by_field && !is_field_drawn(options, drawing);
  if (has_other) {
    drawing.other =
        load_volume(field, field_overrides(options),
                    is_zfp_name(field) ? CompressionOptions{} : options.frame.compression,
                    drawing.device.get());
  }
  drawing.series = open_series(options);
  if (drawing.series) {
    take_step(options, drawing, 0);
    drawing.cameras = make_cameras(options.input, drawing.whole.info, options.frame, drawing.views);
  } else {
    VolumeAndViews scene = load_volume_and_views(options.input, options.volume, options.frame,
                                                 drawing.views, drawing.device.get());
    drawing.whole = std::move(scene.volume);
    drawing.cameras = std::move(scene.cameras);
    options.renderer_flags.values.with_levels = has_levels_to_choose(options, drawing);
  }
  print_compression(options.input, drawing.whole);
  if (has_other) print_compression(field, drawing.other);
  if (options.color_map.by_field)
    options.renderer_flags.values.field = has_other ? &drawing.other : &drawing.whole;
  if (exceeds_host(options, drawing)) {
    drawing.draws_on = ocl::DrawsOn::kDevice;
    drawing.device = open_device(options, false);
  } else if (drawing.on_host()) {
    say_host();
  }
}

void load_bricks(RenderArgs &options, Drawing &drawing) {
  TeamVolumeSource source;
  source.path = options.input;
  source.overrides = to_overrides(options.volume);
  source.bricks = options.bricks;
  source.isovalues.assign(options.frame.isovalues.begin(), options.frame.isovalues.end());
  together(drawing.team, [&] {
    source.storage = storage_for(options.input, options.frame.compression, drawing.device.get());
  });
  drawing.bricks = open_together(drawing.team, source, [&](std::vector<VolumeInfo> &levels) {
    if (!is_zfp_name(options.input)) warn_of_header(options.input, source.overrides);
    check_brick_levels(options, levels);
    if (options.voxel_pixels == 0 && !chooses_levels(options, drawing)) levels.resize(1);
    drawing.cameras = make_cameras(options.input, levels.front(), options.frame, drawing.views);
  });
  if (!options.color_map.by_field) return;
  const std::string &field = options.color_map.field;
  options.renderer_flags.values.field = &drawing.bricks->brick;
  if (is_field_drawn(options, drawing)) return;
  TeamVolumeSource of_field;
  of_field.path = field;
  together(drawing.team, [&] {
    of_field.overrides = field_overrides(options);
    of_field.storage =
        storage_for(field, is_zfp_name(field) ? CompressionOptions{} : options.frame.compression,
                    drawing.device.get());
  });
  drawing.other = open_field_together(drawing.team, of_field, *drawing.bricks);
  options.renderer_flags.values.field = &drawing.other;
}

namespace {

std::unique_ptr<Renderer> make_core_renderer(RenderArgs &options, Drawing &drawing) {
  const ImageSize shown = drawing.views.size,
                  size = options.max_image_error ? with_room_for_tiles(shown) : shown;
  options.renderer = to_renderer_options(options.renderer_flags, size);
  if (options.reference)
    return std::make_unique<TwinRenderer>(drawing.whole, size, options.renderer.solver,
                                          options.renderer.field);
  if (drawing.on_host()) {
    return std::make_unique<HostRenderer>(
        drawing.whole, HostRendererOptions{.memory_limit = options.renderer.memory_budget,
                                           .field = options.renderer.field,
                                           .largest = size});
  }
  if (!drawing.is_team()) {
    auto renderer =
        std::make_unique<DeviceRenderer>(*drawing.device, drawing.whole, options.renderer);
    drawing.on_device = renderer.get();
    return renderer;
  }
  auto renderer = std::make_unique<TeamRenderer>(*drawing.device, *drawing.bricks, options.renderer,
                                                 drawing.team);
  drawing.of_team = renderer.get();
  drawing.on_device = &renderer->renderer();
  return renderer;
}

}  // namespace

void make_renderer(RenderArgs &options, Drawing &drawing) {
  const RendererOptions &wanted = options.renderer_flags.values;
  drawing.renderer = std::make_unique<isowave::Renderer::Implementation>(
      std::make_shared<Turns>(), drawing.volume(),
      add_choices(make_core_renderer(options, drawing),
                  {.with_time_budget = wanted.with_kept_picture}, drawing.volume(),
                  drawing.bricks ? drawing.bricks->rate : drawing.whole.rate()));
  if (drawing.on_device != nullptr) options.renderer = drawing.on_device->options();
}

}  // namespace isowave::core::tools
