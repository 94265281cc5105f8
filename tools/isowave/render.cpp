// isowave render: pictures, depth and statistics of isosurfaces, on an OpenCL device, on the host,
// on the devices of several processes, or by the scalar twin. The library's isowave::Renderer draws
// them; this file reports more than users of the library see.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "core/api/convert.hpp"
#include "core/api/device_renderer.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/text.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/bricks/team_renderer.hpp"
#include "core/frame/surface_camera.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/file_name.hpp"
#include "core/io/movie.hpp"
#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "core/render/device_renderer.hpp"
#include "core/zfp/isovalue.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/compile_report.hpp"
#include "tools/isowave/mpi_team.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_drawing.hpp"
#include "tools/isowave/render_options.hpp"
#include "tools/isowave/render_report.hpp"
#include "tools/isowave/render_series.hpp"
#include "tools/isowave/render_stats.hpp"

namespace isowave::core::tools {

namespace {

/// Most rays of a pixel along each axis for --max-image-error, without --samples.
constexpr std::uint32_t kImageErrorSamples = 4;

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// One frame of the command line, and where its files go.
struct FrameOfMany {
  const RenderArgs &options;
  Drawing &drawing;
  double isovalue;
  std::size_t view;
  std::optional<std::size_t> step;  ///< of a series

  fs::path path(const fs::path &name) const {
    return frame_path(name, drawing.cameras.size(), options, isovalue, view, step);
  }
  isowave::FrameRequest request() const;
  void write_outputs(const isowave::FrameRequest &request, const Frame &frame) const;
  /// The camera of the picture, as a camera file.
  std::string camera_text() const {
    const ImageSize &size = drawing.views.size;
    return camera_file_text({drawing.cameras[view]}, size.width, size.height);
  }
  Image8 annotated(const isowave::FrameRequest &request, const Frame &frame) const;
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
  request.surfaces = options.surfaces;
  request.slices = options.slices;
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
  request.max_image_error = options.max_image_error;
  if (chooses_detail(options) && drawing.cameras.size() > 1)
    std::ranges::transform(drawing.cameras, std::back_inserter(request.series), public_camera);
  request.time_budget_ms = options.time_budget;
  request.want_picture = !options.image.empty() || !options.movie.empty();
  request.want_depth = !options.depth.empty();
  request.want_bounds = draws_bounds(options);
  if (options.progress_dir.empty()) return request;
  request.on_pass = [this](const isowave::Progress &progress) {
    const fs::path name =
        fs::path(options.progress_dir) / fmt::format("pass{:04}.png", progress.passes());
    const Image8 image = image_of(progress.size(), progress.picture());
    if (!image.pixels.empty()) write_png(image, path(name), camera_text());
    return true;
  };
  return request;
}

/// The picture, with its annotations.
Image8 FrameOfMany::annotated(const isowave::FrameRequest &request, const Frame &frame) const {
  Image8 image = image_of(frame.size, frame.picture);
  if (!options.annotations) return image;
  isowave::Annotations wanted = *options.annotations;
  if (wanted.title.empty()) wanted.title = fs::path(options.input).filename().string();
  draw_annotations(image, isowave::annotation_layout(wanted, request, frame.statistics.color_range,
                                                     frame.statistics.slice_range));
  return image;
}

/// All ranks: rank 0 writes what it has got.
void FrameOfMany::write_outputs(const isowave::FrameRequest &request, const Frame &frame) const {
  together(drawing.team, [&] {
    if (drawing.team.rank() != 0) return;
    if (!options.scene.save.empty()) {
      isowave::Scene scene = isowave::scene_of(request);
      scene.volume = options.input;
      scene.index = options.volume.index;
      scene.field = options.color_map.field;
      scene.field_dataset = options.color_map.dataset;
      scene.field_index = options.color_map.index;
      scene.annotations = options.annotations;
      isowave::write_scene(scene, options.scene.save);
    }
    if (!options.image.empty() || drawing.movie) {
      const Image8 image = annotated(request, frame);
      if (!options.image.empty()) write_png(image, path(options.image), camera_text());
      if (drawing.movie) drawing.movie->write(image);
    }
    if (!options.depth.empty())
      write_npy({frame.columns, frame.rows, frame.depth.to_vector()}, path(options.depth));
  });
}

/// With --max-surface-error or --max-image-error: how far the frame may be off.
void FrameOfMany::report_error(const Frame &frame, ordered_json &entry) const {
  together(drawing.team, [&] {
    if (drawing.team.rank() != 0) return;
    const LastFrame &last = drawing.renderer->last();
    const DetailChoice &choice = last.stats.detail.value();
    if (options.max_image_error) {
      entry["error"] = report_image_error(*options.max_image_error, choice);
    } else if (draws_bounds(options)) {
      entry["error"] = tools::report_error(*options.max_surface_error, drawing.volume(), last,
                                           frame, path(options.error_map));
    } else {
      entry["error"] = report_sample(*options.max_surface_error, choice);
    }
  });
}

/// "1 ray hits", "1,234 rays hit"
std::string text_of_hits(std::uint64_t count) {
  return fmt::format("{}{}", with_commas(count), plural(count, " ray hits", " rays hit"));
}

/// --refined: draws the frame once more, however long that takes.
void FrameOfMany::write_refined(isowave::FrameRequest request) const {
  request.time_budget_ms.reset();
  request.want_picture = true;
  request.want_depth = false;
  const Frame refined = drawing.renderer->render(request);
  together(drawing.team, [&] {
    if (drawing.team.rank() == 0)
      write_png(annotated(request, refined), path(options.refined), camera_text());
  });
  fmt::print("  refined: {}, {:.1f} ms more\n", text_of_hits(refined.statistics.hits),
             refined.statistics.total_ms);
}

/// "isovalues 40, 90", "labels 3, 5+7-9".
std::string text_of_surfaces(const RenderArgs &options, double isovalue) {
  if (has_labels(options.surfaces)) {
    std::vector<std::string> groups;
    std::ranges::transform(options.surfaces, std::back_inserter(groups), text_of_labels);
    return fmt::format("labels {}", fmt::join(groups, ", "));
  }
  const std::vector<double> isovalues =
      options.surfaces.empty() ? std::vector{isovalue} : all_isovalues(options);
  return fmt::format("{} {}", plural(isovalues.size(), "isovalue", "isovalues"),
                     fmt::join(isovalues, ", "));
}

/// "1 pass, ", "2 passes, "
std::string counted(std::size_t count, std::string_view one, std::string_view many) {
  return fmt::format("{} {}, ", count, plural(count, one, many));
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
  isowave::FrameRequest request = frame.request();
  request.on_progress = make_frame_bar();
  const Frame drawn = drawing.renderer->render(request);
  request.on_progress = {};  // which erases the bar
  frame.write_outputs(request, drawn);
  const std::uint64_t num_hits = drawn.statistics.hits;
  const LastFrame &last = drawing.renderer->last();
  own = frame_json(frame.isovalue, frame.view, drawing.cameras[frame.view], last.stats,
                   drawing.on_host());
  if (frame.step) own["step"] = *frame.step;
  ordered_json entry = own;
  const std::string what =
      fmt::format("{}{}, view {}", frame.step ? fmt::format("step {}, ", *frame.step) : "",
                  text_of_surfaces(options, frame.isovalue), frame.view);
  if (drawing.is_team()) {
    const double ms = ms_since(begin) - last.certificate.total_ms;
    fmt::print("{}: {}, {}{:.1f} ms\n", what, text_of_hits(num_hits),
               counted(drawing.team.size(), "brick", "bricks"), ms);
    entry = {{"isovalue", frame.isovalue},
             {"view", frame.view},
             {"rays_hit", num_hits},
             {"written_ms", ms},
             {"composition_ms", drawing.of_team->composition().ms - composed_before}};
  } else {
    fmt::print("{}: {}, {}{}{:.1f} ms\n", what, text_of_hits(num_hits),
               draws_layers(options) ? counted(last.stats.layers.layers, "layer", "layers") : "",
               drawing.on_host() ? "" : counted(last.stats.passes.size(), "pass", "passes"),
               drawn.statistics.total_ms);
    entry["total_ms"] = drawn.statistics.total_ms;
  }
  if (const auto &range = drawn.statistics.field_range) {
    fmt::print("  values of the field at the hits: {} to {}\n", (*range)[0], (*range)[1]);
    entry["field_range"] = *range;
  }
  if (options.surfaces.empty()) {
    warn_of_isovalue(drawing.volume(), frame.isovalue);
  } else {
    for (const double isovalue : all_isovalues(options))
      warn_of_isovalue(drawing.volume(), isovalue);
    for (ordered_json *json : {&own, &entry}) json->erase("isovalue");  // surfaces are options
  }
  if (draws_layers(options)) entry["layers"] = report_layers(last.stats.layers);
  if (chooses_detail(options)) frame.report_error(drawn, entry);
  if (options.time_budget) entry["time_budget"] = report_steps(last.stats, *options.time_budget);
  if (!options.refined.empty()) frame.write_refined(request);
  return entry;
}

/// Draws all frames of a volume.
///
/// index               of the step that the volume is, in options.steps
/// frames, own_frames  get the entries of all, and of this process
void draw_step(const RenderArgs &options, Drawing &drawing, std::size_t index, ordered_json &frames,
               ordered_json &own_frames) {
  std::optional<std::size_t> step;
  if (drawing.series) step = options.steps.at(index);
  for (const double isovalue : options.frame.isovalues) {
    for (std::size_t view = 0; view < drawing.cameras.size(); ++view) {
      own_frames.emplace_back();
      frames.push_back(draw_frame({options, drawing, isovalue, view, step}, own_frames.back()));
    }
  }
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

/// --save-camera
void save_cameras(const RenderArgs &options, const Drawing &drawing) {
  if (options.frame.view.save.empty()) return;
  const ImageSize &size = drawing.views.size;
  AtomicFile file(options.frame.view.save);
  file.write(camera_file_text(drawing.cameras, size.width, size.height));
  file.commit();
}

/// If no isovalue was given: takes a suggested one, also for the names of files.
void suggest_isovalue(RenderArgs &options, const Drawing &drawing, Outputs &outputs) {
  if (!options.frame.isovalues.empty()) return;
  options.frame.isovalues = {suggested_isovalue(drawing.whole)};
  options.isovalue_suggested = true;
  if (options.names_picture) options.image = default_image(options, drawing.views.count);
  outputs = check_outputs(options, drawing.views.count);
}

/// Each process makes its own. On CPUs, all of a host wait for the first one, which compiles the
/// kernels for all of them: the driver keeps them.
void make_renderers(RenderArgs &options, Drawing &drawing) {
  const bool is_on_cpu = drawing.is_team() && drawing.device->info().type == ocl::DeviceType::kCpu;
  in_turns(drawing.team, !is_on_cpu || MpiJob::local_rank() == 0,
           [&] { make_renderer(options, drawing); });
}

/// Makes the cameras of drawing.renderer, unless they stand on the circle of --orbit, or a file has
/// them.
void choose_cameras(const RenderArgs &options, Drawing &drawing) {
  const ViewOptions &view = options.frame.view;
  if (options.frame.orbit == 0 && !drawing.views.file) {
    const Viewpoint from = viewpoint_of(view, drawing.views.count);
    const ImageSize size = drawing.views.size;
    Renderer &renderer = drawing.renderer->core();
    const Camera first =
        view.fit == "box" ? surface_camera(drawing.info(), {}, size, from)
        : has_labels(options.surfaces)
            ? renderer.label_camera(labels_of(options.surfaces), size, from)
            : renderer.camera(drawn_isovalues(drawing.volume(), all_isovalues(options)), size,
                              from);
    drawing.cameras =
        turntable(first, drawing.views.count, orientation_of(drawing.info(), from.up).up);
  }
  for (Camera &camera : drawing.cameras) {
    if (options.parallel) camera = in_parallel(camera);
    camera = zoomed(camera, view.zoom);
  }
}

/// Opens the device, if one draws, loads the volume and makes the renderer.
void set_up(const CLI::App &command, RenderArgs &options, Drawing &drawing) {
  Outputs outputs;
  together(drawing.team, [&] {
    if (drawing.team.rank() == 0) {
      outputs = check_outputs(options, drawing.views.count);
      if (const ImageSize &size = drawing.views.size; !options.movie.empty())
        drawing.movie.emplace(options.movie, size.width, size.height, options.fps);
    }
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
    if (options.scene.file.empty()) {
      options.clip = read_clip(options.clip_options, drawing.info());
      options.slices = read_slices(options.slice_options, drawing.info(), drawing.appearance);
    }
  });
  make_renderers(options, drawing);
  if (compiling) compiling->finish();
  choose_cameras(options, drawing);
}

/// What is drawn, as options say it.
void read_scene_of_options(RenderArgs &options, Drawing &drawing) {
  options.surfaces = options.label_texts.empty() ? read_surfaces(options.surface_texts)
                                                 : read_labels(options.label_texts);
  if (!options.surfaces.empty()) options.frame.isovalues = {options.surfaces.front().isovalue};
  drawing.appearance.surface = parse_color("--color", options.color);
  read_background(options.background, drawing.appearance);
  drawing.appearance.transparent = options.transparent;
  read_color_map(options.color_map, drawing.appearance);
  read_light(options.light, drawing.appearance);
}

/// The scene's files, unless VOLUME names another, and where in them the voxels are, unless --index
/// and --field-index say it.
void take_files(const isowave::Scene &scene, RenderArgs &options) {
  isowave::Scene files = scene;
  if (!options.volume.index.empty()) files.index.clear();
  if (!options.color_map.index.empty()) files.field_index.clear();
  const bool has_field = options.color_map.by_field && scene.field != "volume";
  try {
    if (options.input.empty()) scene_volume(files);  // or throws
    if (has_field) scene_field(files);
  } catch (const isowave::Error &error) {
    throw Error("{}: {}", options.scene.file, error.what());
  }
  if (options.input.empty()) {
    options.input = scene.volume.string();
    if (options.volume.index.empty()) options.volume.index = files.index;
  }
  options.color_map.field = scene.field.string();
  options.color_map.dataset = scene.field_dataset;
  if (options.color_map.index.empty()) options.color_map.index = files.field_index;
}

/// What is drawn, as --scene says it. Options may name another volume and other cameras.
void read_scene_of_file(const CLI::App &command, RenderArgs &options, Drawing &drawing) {
  const isowave::Scene scene = read_scene_option(command, options.scene);
  const isowave::FrameRequest request = isowave::scene_request(scene);
  options.frame.isovalues = {request.isovalue};
  options.surfaces = request.surfaces;
  options.slices = request.slices;
  options.clip = core_clip(request.clip, request.caps);
  drawing.appearance = request.appearance;
  options.color_map.by_field = drawing.appearance.color_by_field;
  if (options.color_map.by_field && scene.field.empty())
    throw Error("{}: its colours are by a field, and it names none: add \"field\", a file",
                options.scene.file);
  take_files(scene, options);
  options.transparent = request.appearance.transparent;
  options.light.shadow_rays = request.appearance.shadow_rays;
  options.light.bounce_rays = request.appearance.bounce_rays;
  options.annotations = scene.annotations;
  if (scene.camera && options.frame.orbit == 0 && !drawing.views.file && !chooses_view(command))
    drawing.views.file = CameraFile{{}, {}, {}, {}, {core_camera(*scene.camera)}};
}

/// Reads what is drawn over pictures, and throws before any work what cannot be drawn.
void read_annotations_of(RenderArgs &options, const Drawing &drawing) {
  isowave::Appearance look = drawing.appearance;
  const std::vector<isowave::Slice> slices =
      options.slices.empty() ? read_slices(options.slice_options, {}, look) : options.slices;
  options.annotations =
      read_annotations(options.annotation_options, options.annotations, look, !slices.empty());
  if (!options.annotations || !writes_annotated(options)) return;
  check_annotations();
  const ImageSize &size = drawing.views.size;
  annotation_layout(*options.annotations,
                    {.size = {size.width, size.height}, .appearance = look, .slices = slices}, {});
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
  if (options.max_image_error && command.count("--samples") == 0)
    options.frame.samples = kImageErrorSamples;
  drawing.views = read_views(options.frame);
  if (options.scene.file.empty()) {
    read_scene_of_options(options, drawing);
  } else {
    read_scene_of_file(command, options, drawing);
  }
  count_turntable(options, drawing.views);
  if (options.input.empty()) throw CLI::RequiredError("VOLUME");
  if (options.names_picture) options.image = default_image(options, drawing.views.count);
  check_options(command, options, drawing.team);
  find_series(command, options, drawing.team);
  read_annotations_of(options, drawing);
  if (!options.scene.save.empty() && num_frames(options, drawing.views.count) > 1)
    throw Error("--save-scene: a scene is one picture: draw one isovalue from one view");
  if (options.max_image_error && drawing.appearance.color_by_depth && drawing.views.count > 1)
    throw Error("--max-image-error: colours by depth differ from view to view: draw one view");
  set_wanted(options);
  set_up(command, options, drawing);
  if (options.verbose && drawing.on_device != nullptr)
    print_plan(drawing.on_device->memory_plan(), drawing.volume());
  ordered_json frames = ordered_json::array(), own_frames = frames;
  draw_step(options, drawing, 0, frames, own_frames);
  for (std::size_t index = 1; index < options.steps.size(); ++index) {
    drawing.renderer.reset();  // before the next one takes its memory
    take_step(options, drawing, index);
    make_renderer(options, drawing);
    draw_step(options, drawing, index, frames, own_frames);
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
    if (drawing.team.rank() == 0) save_cameras(options, drawing);
    if (!drawing.movie) return;
    drawing.movie->commit();
    fmt::print("wrote {}: {} {}, {:.3g} s at --fps {}\n", options.movie,
               drawing.movie->num_frames(),
               plural(drawing.movie->num_frames(), "picture", "pictures"),
               double(drawing.movie->num_frames()) / options.fps, options.fps);
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
