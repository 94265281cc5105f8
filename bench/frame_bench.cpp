// frame_bench: whole frames of one volume from an orbit of cameras. Total times without profiling;
// a second run with profiling gives the milliseconds per stage. With --budgets: the total times at
// several memory budgets.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <optional>
#include <utility>

#include "bench/budget_sweep.hpp"
#include "bench/frame_report.hpp"
#include "bench/run_info.hpp"
#include "core/api/frame_parts.hpp"
#include "core/base/error.hpp"
#include "core/render/device_renderer.hpp"
#include "core/view/color_maps.hpp"
#include "tools/isowave/clip_options.hpp"
#include "tools/isowave/label_options.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/renderer_options.hpp"
#include "tools/isowave/slice_options.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/surface_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::bench {

namespace {

struct Options {
  std::string volume, device, json, budgets;
  tools::VolumeOptions volume_options;
  std::optional<float> isovalue;
  tools::CompressionOptions compression{.rate = 4};
  std::uint32_t orbit = 10, rounds = 3, max_passes = 2000;
  std::vector<std::uint32_t> size = {1280, 720};
  std::uint32_t samples = 1;
  bool resident = true;
  std::string normals = "cell";
  std::uint32_t ambient_rays = 0;
  bool depth = false;
  tools::ClipOptions clip;
  tools::SliceOptions slices;
  std::uint32_t surfaces = 0;
  float opacity = 0.3f;
  std::vector<std::string> labels;
  tools::LightOptions light;
  std::string field;
  tools::RendererFlags renderer;
};

/// The one asked for, or the middle of the volume's values.
float isovalue_of(const Options &options, const CompressedVolume &volume) {
  if (options.isovalue) return *options.isovalue;
  const float middle = 0.5f * volume.value_range[0] + 0.5f * volume.value_range[1];
  if (!std::isfinite(middle))
    throw Error("{} does not say its range of values: give --isovalue", options.volume);
  return middle;
}

/// Those of --labels, or the surfaces of --surfaces, around the isovalue.
std::vector<SurfaceStyle> surfaces_of(const Options &options, const CompressedVolume &volume) {
  const float step = (volume.value_range[1] - volume.value_range[0]) / 16;
  std::vector<SurfaceStyle> surfaces;
  for (const isowave::Surface &of_labels : tools::read_labels(options.labels))
    surfaces.push_back(core_style(of_labels));
  for (std::uint32_t i = 0; i < options.surfaces; ++i) {
    const float place = static_cast<float>(i) - 0.5f * static_cast<float>(options.surfaces - 1);
    surfaces.push_back(
        {.isovalue = isovalue_of(options, volume) + step * place, .opacity = options.opacity});
  }
  return surfaces;
}

/// On a device of its own, so that the memory reported is that of drawing.
CompressedVolume load(const std::string &name, const Options &options,
                      const ocl::DeviceInfo &device_info) {
  ocl::Device device(device_info);
  return tools::load_volume(name, tools::to_overrides(options.volume_options), options.compression,
                            &device);
}

/// Stage -> ms of a cold frame, for each view.
std::vector<std::map<std::string, double>> measure_stages(ocl::Device &device,
                                                          DeviceRenderer &renderer,
                                                          const std::vector<Camera> &cameras,
                                                          const FrameRequest &request) {
  renderer.render(seen_from(cameras.front(), request));
  std::vector<std::map<std::string, double>> views(cameras.size());
  for (std::size_t view = 0; view < cameras.size(); ++view) {
    renderer.clear_cache();
    device.timer().collect();  // what clearing took
    const FrameStats frame = renderer.render(seen_from(cameras[view], request));
    for (const PassStats &pass : frame.passes) {
      for (const auto &[stage, ms] : pass.stage_ms) views[view][stage] += ms;
    }
    for (const LaterPasses *later :
         {&frame.normals, &frame.behind, &frame.field, &frame.slices, &frame.ambient}) {
      for (const auto &[stage, ms] : later->stage_ms) views[view][stage] += ms;
    }
  }
  return views;
}

/// The part that does not depend on measurements.
FrameReport make_report(const Options &options, const CompressedVolume &volume,
                        std::string command) {
  FrameReport report;
  report.command = std::move(command);
  report.volume = options.volume;
  report.grid.info = volume.info;
  report.grid.bits_per_block = volume.bits_per_block;
  report.isovalue = isovalue_of(options, volume);
  report.voxel_pixels = options.renderer.voxel_pixels;
  report.normals = normals_from_string(options.normals);
  report.options = tools::to_renderer_options(
      options.renderer, {options.size.at(0), options.size.at(1), options.samples});
  report.ambient_rays = options.ambient_rays;
  report.clip = tools::read_clip(options.clip, volume.info);
  report.surfaces = surfaces_of(options, volume);
  isowave::Appearance slice_colors;
  const auto slices = tools::read_slices(options.slices, volume.info, slice_colors);
  report.slices = core_slices(slices, slice_colors, volume.value_range);
  if (!slices.empty() && report.surfaces.empty()) report.surfaces = {{.isovalue = report.isovalue}};
  report.options.max_surfaces = static_cast<std::uint32_t>(report.surfaces.size());
  report.options.with_labels = !options.labels.empty();
  report.wanted.depth = options.depth;
  isowave::Appearance light;
  tools::read_light(options.light, light);
  report.light = core_appearance(light, volume.info);
  report.shadow_rays = light.shadow_rays;
  report.bounce_rays = light.bounce_rays;
  report.light_angle = light.light_angle;
  const bool by_label = options.field == "labels";
  if (!options.field.empty())
    report.light.color_by_field = {.colors = color_map(by_label ? "labels" : "viridis"),
                                   .labels = by_label};
  report.options.with_given_rays = options.ambient_rays != 0 || light.shadow_rays != 0;
  report.options.with_bounce = light.bounce_rays != 0;
  report.num_views = options.orbit;
  report.rounds = options.rounds;
  return report;
}

FrameReport measure(const Options &options, std::string command) {
  const ocl::DeviceInfo device_info = ocl::choose_device(options.device);
  const CompressedVolume volume = load(options.volume, options, device_info);
  CompressedVolume field;
  const bool is_own = options.field == "labels", has_field = !options.field.empty();
  if (has_field && !is_own) field = load(options.field, options, device_info);
  const std::vector<Camera> cameras = orbit_cameras(volume.info, options.orbit);
  FrameReport report = make_report(options, volume, std::move(command));
  if (has_field) report.options.field = is_own ? &volume : &field;
  std::vector<HitRecord> first_hits;
  {
    ocl::Device device(device_info);
    DeviceRenderer renderer(device, volume, report.options);
    report.run_info = run_info(device);
    report.options = renderer.options();
    report.setup_ms = renderer.setup_ms();
    renderer.render(seen_from(cameras.front(), report.request()));
    if (options.resident) {
      FrameRequest of_cells = without_light_rays(report.request());
      of_cells.normals = Normals::kCell;  // as the floor draws
      of_cells.field_values = false;
      of_cells.surfaces.clear();
      of_cells.slices = {};
      renderer.render(seen_from(cameras.front(), of_cells));
      first_hits = renderer.hits();
    }
    report.views =
        measure_views(renderer, cameras, report.request(), report.wanted, options.rounds);
    report.peak_bytes = device.ledger().peak();
    report.memory = tools::memory_json(device.ledger());
  }
  {
    ocl::Device device(device_info, true);
    DeviceRenderer renderer(device, volume, report.options);
    report.stage_clock = clock_name(device.timer().source());
    report.stage_ms = measure_stages(device, renderer, cameras, report.request());
  }
  if (options.resident) {
    report.floor = measure_floor(device_info, volume, report.options, cameras, report.isovalue,
                                 options.rounds, first_hits);
  }
  return report;
}

/// "auto:N", or bytes separated by commas.
std::vector<std::uint64_t> budgets_of(const Options &options, const ocl::DeviceInfo &device_info,
                                      const CompressedVolume &volume,
                                      const RendererOptions &renderer) {
  constexpr std::string_view kAuto = "auto:";
  if (renderer.memory_budget != 0 || renderer.cache_slots != 0)
    throw Error("--budgets stands for --memory-budget and --cache-slots: give it alone");
  if (options.budgets.starts_with(kAuto)) {
    const std::uint64_t count =
        tools::parse_whole(options.budgets.substr(kAuto.size())).value_or(0);
    if (count < 2 || count > 1000)
      throw Error("--budgets {}: auto:N makes 2 to 1000 budgets", options.budgets);
    return geometric_budgets(device_info, volume, renderer, static_cast<std::uint32_t>(count));
  }
  std::vector<std::uint64_t> budgets;
  for (const std::string &text : CLI::detail::split(options.budgets, ',')) {
    const std::optional<std::uint64_t> bytes = tools::parse_bytes(text);
    if (!bytes) throw Error("--budgets {}: '{}' is no number of bytes", options.budgets, text);
    budgets.push_back(*bytes);
  }
  return budgets;
}

BudgetSweep measure_budgets(const Options &options, std::string command) {
  const ocl::DeviceInfo device_info = ocl::choose_device(options.device);
  const CompressedVolume volume = load(options.volume, options, device_info);
  FrameReport common = make_report(options, volume, std::move(command));
  std::vector<std::uint64_t> budgets = budgets_of(options, device_info, volume, common.options);
  return sweep_budgets(device_info, volume, std::move(common), std::move(budgets),
                       options.max_passes, options.resident);
}

/// Checks that need only the options.
void check_options(const CLI::App &app, const Options &options) {
  tools::check_renderer_options(app, options.renderer);
  check_image_size({options.size.at(0), options.size.at(1), options.samples});
  if (options.budgets.empty()) tools::refuse_options(app, {"--max-passes"}, "is of --budgets");
  tools::Outputs outputs;
  outputs.read_volume(options.volume);
  outputs.write("--json", options.json);
}

/// Prints one report or the other, and writes it where asked.
void run(const CLI::App &app, Options options, const std::string &command) {
  check_options(app, options);
  if (options.renderer.voxel_pixels > 0) tools::want_levels(options.compression);
  // The floor draws the finest level, of one isovalue.
  if (options.renderer.voxel_pixels > 0 || !options.labels.empty()) options.resident = false;
  nlohmann::ordered_json json;
  if (options.budgets.empty()) {
    const FrameReport report = measure(options, command);
    print_report(report);
    json = to_json(report);
  } else {
    const BudgetSweep sweep = measure_budgets(options, command);
    print_sweep(sweep);
    json = to_json(sweep);
  }
  if (!options.json.empty()) tools::write_json(json, options.json);
}

void add_options(CLI::App &app, Options &options) {
  app.add_option("VOLUME", options.volume, "a .zfp file, or " + std::string(tools::kVolumeHelp))
      ->required();
  tools::add_volume_options(app, options.volume_options);
  app.add_option("--isovalue,-i", options.isovalue, "isovalue [the middle of the volume's values]")
      ->check(tools::fits_float32());
  tools::add_compression_options(app, options.compression);
  app.add_option("--size", options.size, "picture size WxH [1280x720]")
      ->delimiter('x')
      ->expected(2);
  app.add_option("--samples", options.samples, "N: N x N rays for each pixel")
      ->check(CLI::Range(1u, ImageSize::kMaxSamples))
      ->capture_default_str();
  app.add_option("--orbit", options.orbit, "views around the volume")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "times that every view is drawn")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_flag("!--no-resident", options.resident,
               "leave out the floor: the whole volume decoded, one kernel");
  app.add_option(
      "--device", options.device,
      "device: index, cpu, gpu, or a part of its name [ISOWAVE_DEVICE, or the first GPU]");
  tools::add_renderer_options(app, options.renderer);
  app.add_option(
      "--budgets", options.budgets,
      "draw the same orbit at each of these memory budgets, e.g. 200MB,400MB,1GB, or auto:N for N "
      "from the smallest to an ample one, in equal ratios of what lies above that; the "
      "pictures must be the same");
  tools::add_normals_option(app, options.normals);
  tools::add_ambient_option(app, options.ambient_rays);
  tools::add_clip_options(app, options.clip);
  tools::add_slice_options(app, options.slices);
  app.add_option(
         "--surfaces", options.surfaces,
         "number of surfaces in layers, a sixteenth of the range of values apart [one opaque "
         "surface]")
      ->check(CLI::Range(0, ISO_MAX_SURFACES))
      ->excludes("--voxel-pixels");
  app.add_option("--opacity", options.opacity, "opacity of --surfaces")
      ->check(CLI::Range(0.01f, 1.0f))
      ->capture_default_str();
  tools::add_labels_option(app, options.labels);
  app.get_option("--labels")->excludes("--surfaces", "--voxel-pixels", "--budgets");
  tools::add_light_options(app, options.light);
  app.add_option("--values-of", options.field,
                 "second volume, whose values at the hits colour surfaces; or `labels`: with "
                 "--labels, each label has its colour")
      ->excludes("--budgets");
  app.add_flag("--depth", options.depth, "bring the picture's depth to the host, too");
  app.add_option("--max-passes", options.max_passes,
                 "of --budgets: a budget at which a frame takes more is not timed")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--json", options.json, "also write everything to this file");
}

}  // namespace

}  // namespace isowave::core::bench

int main(int argc, char **argv) {
  CLI::App app("Times whole frames of a volume: cold, warm and the next view, and each stage.",
               "frame_bench");
  isowave::core::bench::Options options;
  isowave::core::bench::add_options(app, options);
  app.callback([&] {
    isowave::core::bench::run(app, options, fmt::format("{}", fmt::join(argv, argv + argc, " ")));
  });
  return isowave::core::tools::run_program(app, argc, argv);
}
