#include "tools/isowave/render_options.hpp"
#include "tools/isowave/device_choice.hpp"

#include <fmt/format.h>

#include "core/base/error.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/frame/renderer.hpp"
#include "core/io/file_name.hpp"
#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "core/view/detail.hpp"
#include "core/volume/pyramid.hpp"
#include "tools/isowave/help_groups.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace fs = std::filesystem;

std::vector<double> all_isovalues(const RenderArgs &options) {
  if (options.surfaces.empty()) return options.frame.isovalues;
  if (has_labels(options.surfaces)) return {};
  std::vector<double> isovalues;
  for (const isowave::Surface &surface : options.surfaces) isovalues.push_back(surface.isovalue);
  return isovalues;
}

std::size_t num_frames(const RenderArgs &options, std::size_t num_views) {
  return num_views * std::max<std::size_t>(1, options.frame.isovalues.size());
}

fs::path frame_path(const fs::path &path, std::size_t num_views, const RenderArgs &options,
                    double isovalue, std::size_t view, std::optional<std::size_t> step) {
  const bool is_one_of_many = num_frames(options, num_views) > 1;
  if (path.empty() || (!is_one_of_many && !step)) return path;
  std::string name = path.stem().string();
  if (is_one_of_many && options.surfaces.empty()) name += fmt::format("_iso{}", isovalue);
  if (is_one_of_many) name += fmt::format("_view{}", view);
  if (step) name += fmt::format("_step{:0{}}", *step, options.step_digits);
  fs::path result = path;
  result.replace_filename(name + path.extension().string());
  return result;
}

std::string default_image(const RenderArgs &options, std::size_t num_views) {
  const std::string stem = volume_stem(options.input);
  const bool frame_path_has_isovalue =
      num_frames(options, num_views) > 1 && options.surfaces.empty();
  if (frame_path_has_isovalue || options.frame.isovalues.empty()) return stem + ".png";
  if (has_labels(options.surfaces)) return stem + "_labels.png";
  return fmt::format("{}_iso{}.png", stem, fmt::join(all_isovalues(options), "_"));
}

bool draws_layers(const RenderArgs &options) {
  return !options.surfaces.empty() || !options.slice_options.planes.empty() ||
         !options.slices.empty();
}

void print_picture_name(const RenderArgs &options, std::size_t num_views) {
  std::string name = options.image;
  if (num_frames(options, num_views) > 1)
    name = fmt::format("{}_viewK.png", options.surfaces.empty()
                                           ? volume_stem(options.input) + "_isoV"
                                           : fs::path(options.image).stem().string());
  if (!options.series.empty()) name = fmt::format("{}_stepT.png", fs::path(name).stem().string());
  fmt::print("wrote {}; --output names another file\n", name);
}

bool asks_for_output(const RenderArgs &options) {
  for (const std::string *name :
       {&options.image, &options.depth, &options.stats, &options.progress_dir, &options.error_map,
        &options.refined, &options.movie}) {
    if (!name->empty()) return true;
  }
  return false;
}

bool asks_for_picture(const RenderArgs &options) {
  return writes_annotated(options) || !options.progress_dir.empty();
}

bool writes_annotated(const RenderArgs &options) {
  return !options.image.empty() || !options.refined.empty() || !options.movie.empty();
}

bool chooses_detail(const RenderArgs &options) {
  return options.max_surface_error || options.max_image_error;
}

bool chooses_levels(const RenderArgs &options) {
  return chooses_detail(options) && !draws_layers(options);
}

bool draws_bounds(const RenderArgs &options) {
  return options.max_surface_error && options.by == "proof";
}

namespace {

/// Checks --max-surface-error, --max-image-error, --time-budget and the options that need them.
void check_choice(const RenderArgs &options) {
  if (options.by == "sample" && !options.max_surface_error)
    throw Error("--by sample needs --max-surface-error");
  if (!options.max_surface_error && !options.error_map.empty())
    throw Error("--error-map needs --max-surface-error");
  if (!draws_bounds(options) && !options.error_map.empty())
    throw Error("--error-map has proven bounds: leave out --by sample");
  if (!options.time_budget && !options.refined.empty())
    throw Error("--refined needs --time-budget");
  if (!options.max_surface_error && !options.max_image_error && !options.time_budget) return;
  const char *choice = options.max_surface_error ? "--max-surface-error"
                       : options.max_image_error ? "--max-image-error"
                                                 : "--time-budget";
  if (options.reference) throw Error("--reference draws every frame in full: leave out {}", choice);
  if (options.time_budget) check_time_budget(*options.time_budget);
  if (options.time_budget && !options.progress_dir.empty())
    throw Error("--time-budget draws a frame in steps: leave out --progress-dir");
  if (options.max_surface_error) check_max_surface_error(*options.max_surface_error);
  if (options.max_image_error) check_max_image_error(*options.max_image_error);
  if (options.max_surface_error && options.max_image_error)
    throw Error("--max-surface-error and --max-image-error choose the detail: leave out either");
  if (!options.max_surface_error && !options.max_image_error) return;
  if (options.time_budget) throw Error("{} cannot keep a time: leave out --time-budget", choice);
  if (options.frame.voxel_error > 0 || options.voxel_pixels > 0)
    throw Error("{} chooses the detail: leave out --voxel-error and --voxel-pixels", choice);
}

/// Checks what --slice excludes.
void check_slice_options(const CLI::App &command, const RenderArgs &options) {
  if (options.slice_options.planes.empty() && options.slices.empty()) return;
  isowave::Appearance appearance;
  const std::size_t num_slices =
      std::max(options.slices.size(), read_slices(options.slice_options, {}, appearance).size());
  const std::size_t num_surfaces = std::max<std::size_t>(1, options.surfaces.size());
  if (num_surfaces + num_slices > ISO_MAX_SURFACES)
    throw Error("{} surfaces and {} slices are more than a frame can have: give at most {}",
                num_surfaces, num_slices, ISO_MAX_SURFACES);
  refuse_options(command, {"--max-image-error", "--time-budget"},
                 "--slice draws without it: leave out either");
  if (options.renderer_flags.pipeline == "blocks")
    refuse_options(command, {"--slice"}, "--pipeline blocks draws one opaque surface");
  if (solver_from_string(options.renderer_flags.solver).kind != kDefaultSolver.kind)
    refuse_options(command, {"--slice"}, "needs --solver bernstein");
}

/// Ambient and shadow rays of several surfaces end at opaque ones.
void check_light_rays(const RenderArgs &options) {
  if (options.ambient_rays != 0 || options.light.shadow_rays != 0 || options.light.bounce_rays != 0)
    check_some_are_opaque(options.surfaces);
}

/// Checks what --labels excludes.
void check_label_options(const CLI::App &command, const RenderArgs &options, const Team &team) {
  if (team.size() > 1 && options.bricks == "active")
    throw Error("--bricks active counts blocks of isosurfaces: labels are drawn without it");
  refuse_options(command, {"--isovalue", "--surface"},
                 "--labels draws surfaces of labels alone: leave out either");
  refuse_options(command, {"--color"}, "surfaces have colours of their own: --labels LABELS,COLOR");
  refuse_options(command,
                 {"--voxel-pixels", "--voxel-error", "--max-surface-error", "--max-image-error",
                  "--time-budget", "--slice", "--reference", "--rate", "--tolerance",
                  "--tolerance-relative", "--no-data"},
                 "labels are drawn without it: leave it out");
  check_light_rays(options);
  if (!options.slices.empty()) throw Error("labels are drawn without slices");
  if (options.renderer_flags.pipeline == "blocks")
    refuse_options(command, {"--pipeline"}, "pipeline blocks draws no labels: leave it out");
  if (solver_from_string(options.renderer_flags.solver).kind != kDefaultSolver.kind)
    refuse_options(command, {"--solver"}, "labels need --solver bernstein");
}

/// Checks what --surface excludes. Further options that exclude each other are checked by each.
void check_surface_options(const CLI::App &command, const RenderArgs &options, const Team &team) {
  if (options.surfaces.empty()) return;
  if (has_labels(options.surfaces)) {
    check_label_options(command, options, team);
    return;
  }
  refuse_options(command, {"--isovalue"},
                 "draws pictures of one surface each, --surface one of all: leave out either");
  refuse_options(command, {"--color"}, "surfaces have colours of their own: --surface VALUE,COLOR");
  refuse_options(command, {"--max-image-error", "--time-budget"},
                 "--surface draws without it: leave it out, or draw one surface by --isovalue");
  check_light_rays(options);
  if (options.renderer_flags.pipeline == "blocks")
    refuse_options(command, {"--surface"}, "--pipeline blocks draws one opaque surface");
  if (solver_from_string(options.renderer_flags.solver).kind != kDefaultSolver.kind)
    refuse_options(command, {"--surface"}, "needs --solver bernstein");
}

/// Checks --movie and --turntable.
void check_movie_options(const CLI::App &command, const RenderArgs &options) {
  if (options.turntable > 0)
    refuse_options(command, {"--orbit"}, "--turntable draws the views: leave out either");
  if (options.movie.empty()) {
    refuse_options(command, {"--fps"}, "no movie is written: give --movie");
    return;
  }
  refuse_options(command, {"--transparent"}, "movies have no transparency: leave out --movie");
  refuse_options(command, {"--time-budget"},
                 "draws pictures of several sizes, and a movie has one: leave out either");
}

}  // namespace

void count_turntable(const RenderArgs &options, Views &views) {
  if (options.turntable == 0) return;
  views.count = options.turntable;
  if (!views.file) return;
  std::vector<Camera> &cameras = views.file->cameras;
  if (cameras.size() > 1)
    throw Error("--turntable turns one camera, and {} has {}: leave out either",
                options.frame.cameras, cameras.size());
  cameras = turntable(cameras.front(), options.turntable);
}

void check_options(const CLI::App &command, const RenderArgs &options, const Team &team) {
  check_view_options(command, options.frame.view, !options.frame.cameras.empty());
  check_surface_options(command, options, team);
  check_slice_options(command, options);
  check_movie_options(command, options);
  if (!options.color_map.by_field || options.color_map.field == "volume")
    refuse_options(command, {"--field-index"}, "no file's values colour the surface: leave it out");
  if (team.size() > 1) {
    refuse_options(command, {"--reference", "--verbose"},
                   fmt::format("cannot be used with mpirun: {} processes draw parts of the volume",
                               team.size()));
    if (options.frame.isovalues.empty())
      throw Error(
          "with mpirun, no process sees the whole volume: give --isovalue; isowave info suggests "
          "some");
  } else {
    refuse_options(command, {"--bricks"}, "one process draws the whole: start more by mpirun");
  }
  if (options.reference && !options.progress_dir.empty())
    throw Error("--reference has no passes: leave out --progress-dir");
  if (!asks_for_picture(options)) {
    refuse_options(command,
                   {"--color", "--color-by", "--background", "--light", "--shadow", "--bounce",
                    "--light-angle", "--transparent", "--normals", "--ambient", "--slice"},
                   "no picture is written: give --output");
  }
  if (!writes_annotated(options))
    refuse_options(command, {"--annotate", "--units", "--title"},
                   "no picture is annotated: give --output");
  if (!options.color_map.by.empty() && !options.color_map.by_field)
    refuse_options(command, {"--color"}, "--color-by colours surfaces: leave out either");
  if (options.color_map.by_field)
    refuse_options(command, {"--time-budget"}, "colours by a field are drawn without a time");
  if (options.transparent)
    refuse_options(command, {"--background"}, "pictures with --transparent have none");
  if (options.stats.empty())
    refuse_options(command, {"--no-stage-times"}, "no statistics are written: give --stats");
  check_renderer_options(command, options.renderer_flags);
  check_ambient_rays(options.ambient_rays);
  with_fewer_planes({}, options.frame.voxel_error);  // or throws
  check_voxel_pixels(options.voxel_pixels);
  read_clip(options.clip_options, {});  // or throws
  if (options.renderer_flags.pipeline == "blocks")
    refuse_options(command, {"--clip", "--clip-box"}, "--pipeline blocks draws whole volumes");
  if (draws_bounds(options)) {
    refuse_options(command, {"--clip", "--clip-box"},
                   "--max-surface-error is proven of whole surfaces: give --by sample");
  }
  check_choice(options);
}

std::string find_device_option(const CLI::App &command) {
  return first_given(command, {"--cache-slots", "--stream", "--verbose", "--no-stage-times",
                               "--pipeline", "--speculation", "--max-speculation", "--solver",
                               "--grouping", "--closest", "--group-size"});
}

Outputs check_outputs(const RenderArgs &options, std::size_t num_views) {
  Outputs outputs;
  outputs.read_volume(options.input);
  for (const SeriesStep &step : options.series) outputs.read_volume(step.path);
  if (!options.frame.cameras.empty()) outputs.read(options.frame.cameras);
  if (!options.scene.file.empty()) outputs.read(options.scene.file);
  if (options.color_map.by_field && options.color_map.field != "volume")
    outputs.read_volume(options.color_map.field);
  outputs.write("--stats", options.stats);
  outputs.write("--save-scene", options.scene.save);
  outputs.write("--save-camera", options.frame.view.save);
  outputs.write("--movie", options.movie);
  // A suggested isovalue, which is not known yet, changes the names of files, not their folders.
  std::vector<double> isovalues = options.frame.isovalues;
  if (isovalues.empty()) isovalues = {0};
  std::vector<std::optional<std::size_t>> steps(options.steps.begin(), options.steps.end());
  if (steps.empty()) steps.emplace_back();
  for (std::size_t i = 0; i < steps.size() * isovalues.size() * num_views; ++i) {
    const std::size_t view = i % num_views, number = i / num_views;
    const auto write = [&](const char *option, const std::string &name) {
      outputs.write(option,
                    frame_path(name, num_views, options, isovalues[number % isovalues.size()], view,
                               steps[number / isovalues.size()]));
    };
    write("--output", options.image);
    write("--depth", options.depth);
    write("--error-map", options.error_map);
    write("--refined", options.refined);
  }
  outputs.write_pictures("--progress-dir", options.progress_dir, "pass");
  for (const std::string &name : {options.image, options.refined}) check_png_name(name);
  for (const std::string &name : {options.depth, options.error_map}) check_npy_name(name);
  for (const std::string &name : {options.stats, options.scene.save}) check_json_name(name);
  return outputs;
}

void check_brick_levels(const RenderArgs &options, const std::vector<VolumeInfo> &levels) {
  if (levels.size() > 1 || max_levels(levels.front().dims) == 1) return;
  const CompressionOptions &compression = options.frame.compression;
  const bool makes_levels =
      !is_zfp_name(options.input) &&
      (compression.levels != 1 || (chooses_levels(options) && !says_levels(compression)));
  if (options.voxel_pixels == 0 && !makes_levels) return;
  throw Error(
      "{} has no levels of detail, which bricks cannot make: isowave convert --levels all{}",
      options.input, chooses_levels(options) ? ", or do without them: --levels 1" : "");
}

namespace {

/// Options of every day come first, those of researchers last.
void group_render_options(CLI::App &command) {
  group_options(command, "Options of every day",
                {"--help",     "--isovalue",  "--surface",     "--labels",      "--scene",
                 "--output",   "--size",      "--samples",     "--steps",       "--color",
                 "--color-by", "--color-map", "--field-index", "--background",  "--transparent",
                 "--light",    "--shadow",    "--bounce",      "--light-angle", "--normals",
                 "--ambient",  "--annotate",  "--units",       "--title",       "--device"});
  group_options(command, "Views",
                {"--view", "--up", "--zoom", "--fit", "--orbit", "--turntable", "--cameras",
                 "--save-camera", "--parallel"});
  group_options(command, "Clipping and slices",
                {"--clip", "--clip-box", "--no-caps", "--slice", "--slice-opacity", "--slice-map",
                 "--slice-range"});
  group_volume_options(command);
  group_compression_options(command);
  group_options(command, "Precision and time",
                {"--voxel-pixels", "--voxel-error", "--max-surface-error", "--by", "--error-map",
                 "--max-image-error", "--time-budget", "--refined"});
  group_options(command, "Memory", {"--memory-budget", "--cache-slots", "--stream", "--verbose"});
  group_options(command, "Several processes, by mpirun", {"--bricks"});
  group_options(command, "Further outputs",
                {"--movie", "--fps", "--depth", "--save-scene", "--stats", "--no-stage-times",
                 "--progress-dir"});
  group_options(command, "For researchers",
                {"--reference", "--pipeline", "--speculation", "--max-speculation", "--solver",
                 "--grouping", "--closest", "--group-size"});
}

void add_color_options(CLI::App &command, RenderArgs &options) {
  command.add_option("--color", options.color, "surface colour: #RRGGBB, or a name of --surface")
      ->capture_default_str();
  add_color_map_options(command, options.color_map);
  add_light_options(command, options.light);
  command
      .add_option(
          "--background", options.background,
          "background colour: #RRGGBB, or a name of --surface; with two, a gradient from the "
          "lower edge to the upper")
      ->type_name("COLOR[,COLOR]")
      ->capture_default_str();
  command.add_flag("--transparent", options.transparent,
                   "RGBA pictures instead of a background: alpha is the share of a pixel's rays "
                   "that hit, and the colour is theirs (straight alpha)");
}

void add_picture_options(CLI::App &command, RenderArgs &options) {
  command
      .add_option(
          "--steps", options.steps_text,
          "steps of a series that are drawn: FIRST:LAST, both counted from 0 and both drawn, "
          "or one number; with FIRST:LAST:STRIDE not all between. A series is a quoted "
          "pattern of files, 'run_*.nrrd', in natural order, or a NIfTI or NRRD file with a "
          "fourth axis. All steps have the cameras of the first. The next step is read while "
          "one is drawn, so memory holds two [all]")
      ->type_name("FIRST[:LAST[:STRIDE]]");
  command
      .add_option(
          "--turntable", options.turntable,
          "number of views once around what --fit says, about --up, from so far that it is in all "
          "pictures; a camera of --cameras or --scene is turned about its own up axis")
      ->check(CLI::Range(1u, kMostViews));
  command.add_option("--output,-o", options.image,
                     "PNG of the picture; NAME_isoV_viewK.png, with --surface NAME_viewK.png, if "
                     "there are several frames, and NAME_..._stepT.png of a series "
                     "[VOLUME_isoV.png in the current folder, if no other output is asked for]");
  command.add_option("--movie", options.movie,
                     "MP4 of all pictures in their order: of each step, each isovalue, all views. "
                     "The program ffmpeg makes it, H.264, of an even width and height");
  command.add_option("--fps", options.fps, "pictures a second of --movie")->capture_default_str();
  command.add_option("--depth", options.depth,
                     "float32 .npy [H,W]: distance from the eye, inf if nothing is hit; with "
                     "--samples for each ray");
}

}  // namespace

void add_render_options(CLI::App &command, RenderArgs &options) {
  command.add_option(
      "VOLUME", options.input,
      fmt::format("a .zfp file, or {}; or several, see --steps [that of --scene]", kVolumeHelp));
  add_volume_options(command, options.volume);
  add_frame_options(command, options.frame)
      ->description(
          "isovalue; repeat it for more pictures, of each isovalue from all views [the first that "
          "`isowave info` suggests]");
  add_view_options(command, options.frame.view);
  add_surface_option(command, options.surface_texts);
  add_labels_option(command, options.label_texts);
  add_scene_options(command, options.scene);
  command
      .add_option("--samples", options.frame.samples,
                  "N x N rays per pixel, whose mean colour it gets; other options still count the "
                  "picture's pixels. With --max-image-error: the most [4]")
      ->check(CLI::Range(1u, ImageSize::kMaxSamples))
      ->capture_default_str();
  command.add_option("--device", options.device,
                     "host: this program draws, without OpenCL; or an OpenCL device: index, cpu, "
                     "gpu, or a part of its name (see `isowave devices`); several, with commas: "
                     "for the first process of a host, the second, ... [ISOWAVE_DEVICE, or the "
                     "first GPU, or the host]");
  command.add_option("--bricks", options.bricks,
                     "how to cut the volume, one brick per process: XxYxZ bricks along each axis, "
                     "or active to give each brick the same number of surface blocks [bricks of "
                     "equal size]");
  command.add_flag("--parallel", options.parallel,
                   "draw all views in parallel (orthographic) projection; the point that a camera "
                   "looks at keeps its scale");
  add_color_options(command, options);
  add_normals_option(command, options.normals);
  add_ambient_option(command, options.ambient_rays);
  add_annotation_options(command, options.annotation_options);
  add_clip_options(command, options.clip_options);
  add_slice_options(command, options.slice_options);
  add_picture_options(command, options);
  command.add_option(
      "--max-surface-error", options.max_surface_error,
      "largest distance to the surface of the uncompressed volume [pixels]: levels of detail and "
      "bit planes are chosen so that most pixels keep it, and the share of certain pixels is "
      "printed; see --by. With --surface or --slice, of each ray's first hit, by bit planes alone");
  command
      .add_option("--by", options.by,
                  "evidence for --max-surface-error. proof: bounds of each pixel's error. sample: "
                  "with 95 % confidence, 99 % of the rays that hit are so near to the surface at "
                  "full detail, beside the ray or along it, judged by some of them; needs no "
                  "measured errors")
      ->check(CLI::IsMember({"proof", "sample"}))
      ->capture_default_str();
  command.add_option(
      "--error-map", options.error_map,
      "float32 .npy [H,W] for --max-surface-error: the bound of each pixel, or ray; inf: there "
      "is none");
  command.add_option(
      "--max-image-error", options.max_image_error,
      "largest error of the picture, the mean of FLIP's over all pixels, 0 to 1, against 64 rays a "
      "pixel at full detail: rays, up to --samples, and levels of detail are chosen so that it is "
      "kept with 95 % confidence, by tiles of the picture");
  command.add_option("--time-budget", options.time_budget,
                     "time for each frame [ms]: draws a small picture first, if need be, then "
                     "larger ones, as long as there is time");
  command.add_option("--refined", options.refined,
                     "PNG for --time-budget: the whole picture, drawn afterwards");
  command.add_option("--stats", options.stats, "file for JSON statistics of every frame and pass");
  command.add_flag(
      "--no-stage-times", options.no_stage_times,
      "leave ms per stage out of --stats, since the host waits after each pass to measure them");
  command.add_flag("--verbose", options.verbose, "print the plan of the device's memory");
  command.add_option("--progress-dir", options.progress_dir,
                     "folder for pictures, one after every pass");
  add_renderer_options(command, options.renderer_flags);
  command.add_flag(
      "--reference", options.reference,
      "use the scalar C++ reference instead of a device or the host; options that say how a device "
      "draws then have no effect");
  command.get_option("--orbit")->description(
      "number of views around the volume, about --up, 20 degrees above its middle [one view]");
  group_render_options(command);
}

}  // namespace isowave::core::tools
