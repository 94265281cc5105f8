// isowave render: pictures, depth and statistics of isosurfaces, on an OpenCL device, on the host,
// on the devices of several processes, or by the scalar twin. The library's isowave::Renderer draws
// them; this file makes the renderer that a command line asks for, and reports more than users of
// the library see.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "core/api/choices.hpp"
#include "core/api/convert.hpp"
#include "core/api/device_renderer.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/bricks/team_renderer.hpp"
#include "core/host/host_renderer.hpp"
#include "core/io/file_name.hpp"
#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "core/render/device_renderer.hpp"
#include "core/stages/march_packets.hpp"
#include "core/zfp/isovalue.hpp"
#include "reference/twin_renderer.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/compile_report.hpp"
#include "tools/isowave/mpi_team.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_options.hpp"
#include "tools/isowave/render_report.hpp"
#include "tools/isowave/render_stats.hpp"

namespace isowave::core::tools {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// The renderer of a command line, and what it needs, in the order in which it is made.
struct Drawing {
  explicit Drawing(Team &of) : team(of) {}

  Team &team;
  Views views{};
  std::vector<Camera> cameras{};
  isowave::Appearance appearance{};
  std::unique_ptr<ocl::Device> device{};  ///< none with --reference, and on the host
  std::optional<TeamVolume> bricks{};     ///< of several processes
  CompressedVolume whole{};               ///< of one process
  std::unique_ptr<isowave::Renderer::Implementation> renderer{};
  TeamRenderer *of_team = nullptr;                ///< in the renderer, if several processes draw
  const DeviceRenderer *on_device = nullptr;      ///< this process's, if a device draws
  ocl::DrawsOn draws_on = ocl::DrawsOn::kDevice;  ///< not with --reference

  bool is_team() const { return team.size() > 1; }
  bool on_host() const { return draws_on != ocl::DrawsOn::kDevice; }
  const CompressedVolume &volume() const { return bricks ? bricks->brick : whole; }
  const VolumeInfo &info() const { return bricks ? bricks->whole() : whole.info; }
};

std::unique_ptr<ocl::Device> open_device(const RenderArgs &options, bool is_team) {
  const ocl::DeviceInfo info = is_team ? choose_local_device(options.device, MpiJob::local_rank())
                                       : ocl::choose_device(options.device);
  fmt::print("device {}: {} ({}); choose another with --device or ISOWAVE_DEVICE\n", info.index,
             info.name, info.platform);
  return std::make_unique<ocl::Device>(info, !options.stats.empty() && !options.no_stage_times);
}

/// The options that the renderer must be made with, for any volume.
void set_wanted(RenderArgs &options) {
  RendererOptions &wanted = options.renderer_flags.values;
  wanted.with_shading = asks_for_picture(options);
  wanted.with_kept_picture = options.time_budget.has_value();
  wanted.with_given_rays = options.ambient_rays != 0;
  wanted.with_bounds = draws_bounds(options);
  options.frame.compression.measure_error |= wanted.with_bounds;
  if (!wanted.with_shading) options.normals = to_string(Normals::kCell);  // no picture shows them
}

/// Chooses between the host and devices.
void choose_drawing(const CLI::App &command, const RenderArgs &options, Drawing &drawing) {
  if (options.reference || drawing.is_team()) return;
  drawing.draws_on = ocl::choose_drawing(options.device);
  const std::string option = find_device_option(command);
  if (option.empty() || !drawing.on_host()) return;
  if (drawing.draws_on == ocl::DrawsOn::kHost)
    throw Error("{}: the host has no such option: leave it out, or name a device", option);
  if (ocl::list_devices().empty())
    throw Error("{}: it needs an OpenCL device, and there is none: leave it out", option);
  drawing.draws_on = ocl::DrawsOn::kDevice;
}

/// Whether a device must draw instead of the host, whose memory is not enough for the volume.
bool exceeds_host(const RenderArgs &options, const Drawing &drawing) {
  return drawing.draws_on == ocl::DrawsOn::kHostByDefault &&
         !HostRenderer::fits(drawing.whole, options.renderer_flags.values.memory_budget) &&
         !ocl::list_devices().empty();
}

/// Whether levels of detail are chosen among those that the volume has. Small pictures of a time
/// budget keep the finest level on CPUs: Abilities::levels_pay.
bool chooses_levels(const RenderArgs &options, const Drawing &drawing) {
  return options.max_surface_error ||
         (options.time_budget && drawing.device && options.renderer_flags.pipeline != "blocks" &&
          !MarchPackets::suits(drawing.device->info()));
}

void load_alone(RenderArgs &options, Drawing &drawing) {
  if (options.voxel_pixels > 0 || chooses_levels(options, drawing))
    want_levels(options.frame.compression);
  Scene scene =
      load_scene(options.input, options.volume, options.frame, drawing.views, drawing.device.get());
  print_compression(options.input, scene.volume);
  options.renderer_flags.values.with_levels =
      chooses_levels(options, drawing) && !scene.volume.coarser_levels.empty();
  drawing.whole = std::move(scene.volume);
  drawing.cameras = std::move(scene.cameras);
  if (exceeds_host(options, drawing)) {
    drawing.draws_on = ocl::DrawsOn::kDevice;
    drawing.device = open_device(options, false);
  } else if (drawing.on_host()) {
    fmt::print("host: {} threads; choose a device with --device or ISOWAVE_DEVICE\n",
               thread_count(0));
  }
}

void load_bricks(const RenderArgs &options, Drawing &drawing) {
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
}

std::unique_ptr<Renderer> make_core_renderer(RenderArgs &options, Drawing &drawing) {
  const ImageSize size = drawing.views.size;
  options.renderer = to_renderer_options(options.renderer_flags, size);
  if (options.reference)
    return std::make_unique<TwinRenderer>(drawing.whole, size, options.renderer.solver);
  if (drawing.on_host()) {
    return std::make_unique<HostRenderer>(
        drawing.whole,
        HostRendererOptions{.memory_limit = options.renderer.memory_budget, .largest = size});
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

void make_renderer(RenderArgs &options, Drawing &drawing) {
  const RendererOptions &wanted = options.renderer_flags.values;
  drawing.renderer = std::make_unique<isowave::Renderer::Implementation>(
      std::make_shared<Turns>(), drawing.volume(),
      add_choices(make_core_renderer(options, drawing),
                  {.with_time_budget = wanted.with_kept_picture}, drawing.volume(),
                  drawing.bricks ? drawing.bricks->rate : drawing.whole.rate()));
  if (drawing.on_device != nullptr) options.renderer = drawing.on_device->options();
}

/// One frame of the command line, and where its files go.
struct FrameOfMany {
  const RenderArgs &options;
  Drawing &drawing;
  double isovalue;
  std::size_t view;

  fs::path path(const fs::path &name) const {
    return frame_path(name, drawing.cameras.size(), options, isovalue, view);
  }
  isowave::FrameRequest request() const;
  void write_outputs(const Frame &frame) const;
  void report_error(const Frame &frame, ordered_json &entry) const;
  void write_refined(isowave::FrameRequest request) const;
};

Image8 image_of(const isowave::ImageSize &size, const isowave::Array<std::uint8_t> &picture) {
  const std::size_t num_pixels = std::size_t{size.width} * size.height;
  return {size.width, size.height, picture.size() == 4 * num_pixels ? 4u : 3u, picture.to_vector()};
}

/// With --progress-dir, the picture after every pass is written.
isowave::FrameRequest FrameOfMany::request() const {
  const ImageSize &size = drawing.views.size;
  isowave::FrameRequest request;
  request.camera = public_camera(drawing.cameras[view]);
  request.isovalue = isovalue;
  request.size = {size.width, size.height, size.samples};
  request.appearance = drawing.appearance;
  for (const ClipPlane &plane : options.clip.planes)
    request.clip.push_back({from_glm(plane.normal), plane.offset});
  request.caps = options.clip.caps;
  // A volume too small for coarser levels is drawn by its finest.
  const bool has_one_level = drawing.on_host() && drawing.whole.coarser_levels.empty();
  request.voxel_pixels = has_one_level ? 0 : options.voxel_pixels;
  request.voxel_error = options.frame.voxel_error;
  request.normals = static_cast<isowave::Normals>(normals_from_string(options.normals));
  request.ambient_rays = options.ambient_rays;
  request.max_surface_error = options.max_surface_error;
  if (options.by == "sample") request.by = isowave::Evidence::kSample;
  if (options.max_surface_error && drawing.cameras.size() > 1)
    std::ranges::transform(drawing.cameras, std::back_inserter(request.series), public_camera);
  request.time_budget_ms = options.time_budget;
  request.want_picture = !options.image.empty();
  request.want_depth = !options.depth.empty();
  request.want_bounds = draws_bounds(options);
  if (options.progress_dir.empty()) return request;
  request.on_pass = [this](const isowave::Progress &progress) {
    const fs::path name =
        fs::path(options.progress_dir) / fmt::format("pass{:04}.png", progress.passes());
    const Image8 image = image_of(progress.size(), progress.picture());
    if (!image.pixels.empty()) write_png(image, path(name));
    return true;
  };
  return request;
}

/// All ranks: rank 0 writes what it has got.
void FrameOfMany::write_outputs(const Frame &frame) const {
  together(drawing.team, [&] {
    if (drawing.team.rank() != 0) return;
    if (!options.image.empty()) write_png(image_of(frame.size, frame.picture), path(options.image));
    if (!options.depth.empty())
      write_npy({frame.columns, frame.rows, frame.depth.to_vector()}, path(options.depth));
  });
}

/// With --max-surface-error: how far the frame may be off.
void FrameOfMany::report_error(const Frame &frame, ordered_json &entry) const {
  together(drawing.team, [&] {
    if (drawing.team.rank() != 0) return;
    const LastFrame &last = drawing.renderer->last();
    entry["error"] = draws_bounds(options)
                         ? tools::report_error(*options.max_surface_error, drawing.volume(), last,
                                               frame, path(options.error_map))
                         : report_sample(*options.max_surface_error, last.stats.detail.value());
  });
}

/// --refined: draws the frame once more, however long that takes.
void FrameOfMany::write_refined(isowave::FrameRequest request) const {
  request.time_budget_ms.reset();
  request.want_picture = true;
  request.want_depth = false;
  const Frame refined = drawing.renderer->render(request);
  together(drawing.team, [&] {
    if (drawing.team.rank() == 0)
      write_png(image_of(refined.size, refined.picture), path(options.refined));
  });
  fmt::print("  refined: {} rays hit, {:.1f} ms more\n", with_commas(refined.statistics.hits),
             refined.statistics.total_ms);
}

/// Draws one frame and all that is asked of it.
///
/// own      gets this process's statistics
/// Returns  the entry of the whole frame
ordered_json draw_frame(const FrameOfMany &frame, ordered_json &own) {
  const RenderArgs &options = frame.options;
  Drawing &drawing = frame.drawing;
  const auto begin = std::chrono::steady_clock::now();
  const double composed_before = drawing.is_team() ? drawing.of_team->composition().ms : 0;
  const isowave::FrameRequest request = frame.request();
  const Frame drawn = drawing.renderer->render(request);
  frame.write_outputs(drawn);
  const std::uint64_t num_hits = drawn.statistics.hits;
  const LastFrame &last = drawing.renderer->last();
  own = frame_json(frame.isovalue, frame.view, drawing.cameras[frame.view], last.stats,
                   drawing.on_host());
  ordered_json entry = own;
  if (drawing.is_team()) {
    const double ms = ms_since(begin) - last.certificate.total_ms;
    fmt::print("isovalue {}, view {}: {} rays hit, {} bricks, {:.1f} ms\n", frame.isovalue,
               frame.view, with_commas(num_hits), drawing.team.size(), ms);
    entry = {{"isovalue", frame.isovalue},
             {"view", frame.view},
             {"rays_hit", num_hits},
             {"written_ms", ms},
             {"composition_ms", drawing.of_team->composition().ms - composed_before}};
  } else {
    fmt::print("isovalue {}, view {}: {} rays hit, {}{:.1f} ms\n", frame.isovalue, frame.view,
               with_commas(num_hits),
               drawing.on_host() ? "" : fmt::format("{} passes, ", last.stats.passes.size()),
               drawn.statistics.total_ms);
    entry["total_ms"] = drawn.statistics.total_ms;
  }
  warn_of_isovalue(drawing.volume(), frame.isovalue);
  if (options.max_surface_error) frame.report_error(drawn, entry);
  if (options.time_budget) entry["time_budget"] = report_steps(last.stats, *options.time_budget);
  if (!options.refined.empty()) frame.write_refined(request);
  return entry;
}

/// --stats of one process.
ordered_json document_of_one(const RenderArgs &options, const Drawing &drawing,
                             const ordered_json &frames) {
  ordered_json document = {{"program", program_name()},
                           {"volume", volume_json(options, drawing.whole)}};
  if (drawing.device) document["device"] = device_json(drawing.device->info());
  if (drawing.on_host()) {
    document["host"] = {{"threads", thread_count(0)},
                        {"setup_ms", drawing.renderer->setup_ms()},
                        {"memory", drawing.renderer->memory_bytes()}};
  }
  document["options"] =
      options_json(options, drawing.views.size, drawing.cameras.size(), drawing.on_host());
  if (!drawing.device) {
    document["frames"] = frames;
    return document;
  }
  document["setup_ms"] = drawing.renderer->setup_ms();
  document["compile_ms"] = drawing.device->compile_ms();
  document["frames"] = frames;
  const MemoryPlan &plan = drawing.on_device->memory_plan();
  document["cache_slots"] = {{"first", options.renderer.cache_slots},
                             {"last", plan.cache_slots},
                             {"most", plan.most_slots}};
  document["memory"] = memory_json(drawing.device->ledger());
  return document;
}

ordered_json document_of_rank(const RenderArgs &options, const Drawing &drawing,
                              const ordered_json &own_frames) {
  const CompositionStats &composition = drawing.of_team->composition();
  const BlockBox &own = drawing.bricks->cuts.bricks()[drawing.team.rank()];
  return {{"rank", drawing.team.rank()},
          {"device", device_json(drawing.device->info())},
          {"brick",
           {{"begin", {own.begin.x, own.begin.y, own.begin.z}},
            {"end", {own.end.x, own.end.y, own.end.z}}}},
          {"volume", volume_json(options, drawing.volume())},
          {"setup_ms", drawing.renderer->setup_ms()},
          {"compile_ms", drawing.device->compile_ms()},
          {"composition",
           {{"reductions", composition.reductions},
            {"bytes", composition.bytes},
            {"ms", composition.ms}}},
          {"frames", own_frames},
          {"memory", memory_json(drawing.device->ledger())}};
}

/// --stats of a team, of which each rank gives its part.
ordered_json document_of_team(const RenderArgs &options, const Drawing &drawing,
                              const ordered_json &frames, const ordered_json &own_frames) {
  ordered_json ranks = ordered_json::array();
  for (const std::string &text :
       drawing.team.all_gather(json_text(document_of_rank(options, drawing, own_frames))))
    ranks.push_back(ordered_json::parse(text));
  const VolumeInfo &whole = drawing.info();
  return {{"program", program_name()},
          {"volume",
           {{"file", options.input},
            {"dims", {whole.dims.x, whole.dims.y, whole.dims.z}},
            {"spacing", {whole.spacing.x, whole.spacing.y, whole.spacing.z}},
            {"type", to_string(whole.type)},
            {"blocks", num_blocks({glm::ivec3(0), blocks_along(whole)})}}},
          {"options", options_json(options, drawing.views.size, drawing.cameras.size(), false)},
          {"frames", frames},
          {"ranks", ranks}};
}

void print_picture_name(const RenderArgs &options, std::size_t num_views) {
  fmt::print("wrote {}; --output names another file\n",
             num_frames(options, num_views) == 1
                 ? options.image
                 : fmt::format("{}_isoV_viewK.png", volume_stem(options.input)));
}

/// If no isovalue was given: takes a suggested one, also for the names of files.
void suggest_isovalue(RenderArgs &options, const Drawing &drawing, Outputs &outputs) {
  if (!options.frame.isovalues.empty()) return;
  options.frame.isovalues = {suggested_isovalue(drawing.whole)};
  options.isovalue_suggested = true;
  if (options.names_picture) options.image = default_image(options, drawing.views.count);
  outputs = check_outputs(options, drawing.views.count);
}

/// Opens the device, if one draws, loads the volume and makes the renderer.
void set_up(const CLI::App &command, RenderArgs &options, Drawing &drawing) {
  Outputs outputs;
  together(drawing.team, [&] {
    if (drawing.team.rank() == 0) outputs = check_outputs(options, drawing.views.count);
    choose_drawing(command, options, drawing);
    if (!options.reference && !drawing.on_host())
      drawing.device = open_device(options, drawing.is_team());
  });
  // Compressing the volume compiles kernels, too.
  std::optional<CompileReport> compiling;
  if (drawing.device && !drawing.is_team()) compiling.emplace(*drawing.device);
  if (drawing.is_team()) {
    load_bricks(options, drawing);
  } else {
    load_alone(options, drawing);
    suggest_isovalue(options, drawing, outputs);
    if (drawing.device && !compiling) compiling.emplace(*drawing.device);  // instead of the host
  }
  together(drawing.team, [&] {
    outputs.make_folder();
    options.clip = read_clip(options.clip_options, drawing.info());
    make_renderer(options, drawing);
  });
  if (compiling) compiling->finish();
  const bool fits_surface = options.frame.orbit == 0 && options.frame.cameras.empty();
  if (fits_surface) {
    drawing.cameras = {drawing.renderer->core().camera(
        drawn_isovalues(drawing.volume(), options.frame.isovalues), drawing.views.size)};
  }
  if (options.parallel)
    std::ranges::transform(drawing.cameras, drawing.cameras.begin(), in_parallel);
}

void run_render(const CLI::App &command, RenderArgs options) {
  TeamOfOne alone;
  Team *const of_job = MpiJob::team();
  Drawing drawing(of_job != nullptr ? *of_job : alone);
  if (drawing.is_team()) {
    agree_on(drawing.team, "version", program_name());
    agree_on(drawing.team, "command line", MpiJob::command_line());
  }
  options.voxel_pixels = options.renderer_flags.voxel_pixels;
  options.names_picture = !asks_for_output(options);
  drawing.views = read_views(options.frame);
  if (options.names_picture) options.image = default_image(options, drawing.views.count);
  check_options(command, options, drawing.team);
  drawing.appearance.surface = parse_color("--color", options.color);
  drawing.appearance.background = parse_color("--background", options.background);
  drawing.appearance.transparent = options.transparent;
  set_wanted(options);
  set_up(command, options, drawing);
  if (options.verbose && drawing.on_device != nullptr)
    print_plan(drawing.on_device->memory_plan(), drawing.volume());
  ordered_json frames = ordered_json::array(), own_frames = frames;
  for (const double isovalue : options.frame.isovalues) {
    for (std::size_t view = 0; view < drawing.cameras.size(); ++view) {
      own_frames.emplace_back();
      frames.push_back(draw_frame({options, drawing, isovalue, view}, own_frames.back()));
    }
  }
  ordered_json document = drawing.is_team() ? document_of_team(options, drawing, frames, own_frames)
                                            : document_of_one(options, drawing, frames);
  if (!drawing.is_team() && drawing.device) {
    fmt::print("setup {:.0f} ms; device memory: peak {:.1f} MiB\n", drawing.renderer->setup_ms(),
               double(drawing.device->ledger().peak()) / (1 << 20));
  } else if (drawing.on_host()) {
    fmt::print("setup {:.0f} ms; host memory: {:.1f} MiB\n", drawing.renderer->setup_ms(),
               double(drawing.renderer->memory_bytes()) / (1 << 20));
  }
  together(drawing.team, [&] {
    if (drawing.team.rank() == 0 && !options.stats.empty()) write_json(document, options.stats);
  });
  if (options.names_picture) print_picture_name(options, drawing.views.count);
}

}  // namespace

void add_render(CLI::App &app) {
  CLI::App *command =
      app.add_subcommand("render", "Draw isosurfaces: PNG pictures, depth and statistics");
  const auto options = std::make_shared<RenderArgs>();
  add_render_options(*command, *options);
  command->callback([command, options] { run_render(*command, *options); });
}

}  // namespace isowave::core::tools
