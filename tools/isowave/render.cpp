// isowave render: pictures, depth and statistics of isosurfaces, on an OpenCL device or by the
// scalar twin.

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "core/accuracy/choose_detail.hpp"
#include "core/base/error.hpp"
#include "core/bricks/brick_renderer.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/io/file_name.hpp"
#include "core/io/npy.hpp"
#include "core/render/renderer.hpp"
#include "core/render/surface_camera.hpp"
#include "core/render/time_budget.hpp"
#include "core/view/detail.hpp"
#include "core/volume/pyramid.hpp"
#include "core/volume/range_thresholds.hpp"
#include "core/zfp/describe_compression.hpp"
#include "core/zfp/isovalue.hpp"
#include "reference/twin.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/compile_report.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/help_groups.hpp"
#include "tools/isowave/mpi_team.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/renderer_options.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct RenderArgs {
  std::string input;
  VolumeOptions volume;
  FrameOptions frame;
  std::string device;
  RendererFlags renderer_flags;
  RendererOptions renderer;  ///< what the flags ask for
  bool reference = false, no_stage_times = false, verbose = false;
  std::string color = "#DBBD87", background = "#FFFFFF";
  std::string image, depth, stats, progress_dir, error_map, refined;
  std::optional<double> max_surface_error;  ///< pixels
  std::optional<double> time_budget;        ///< ms
  double voxel_pixels = 0;                  ///< of whole frames
  std::string normals = "smooth";
  std::uint32_t ambient_rays = 0;
  std::string bricks;  ///< XxYxZ, or "active"
};

/// "#RRGGBB" -> [0,1]^3.
glm::vec3 parse_color(const char *option, const std::string &text) {
  std::uint32_t rgb = 0;
  const char *end = text.data() + text.size();
  if (text.size() == 7 && text[0] == '#') {
    const auto parsed = std::from_chars(text.data() + 1, end, rgb, 16);
    if (parsed.ec == std::errc{} && parsed.ptr == end) {
      return {float(rgb >> 16) / 255.0f, float(rgb >> 8 & 255u) / 255.0f,
              float(rgb & 255u) / 255.0f};
    }
  }
  throw Error("{} {}: give a colour as #RRGGBB", option, text);
}

/// Where a frame's file goes: the name as given for a single frame, else NAME_isoV_viewK.EXT. Empty
/// for an empty name.
fs::path frame_path(const fs::path &path, std::size_t num_views, const RenderArgs &options,
                    double isovalue, std::size_t view) {
  if (path.empty() || num_views * options.frame.isovalues.size() == 1) return path;
  fs::path result = path;
  result.replace_filename(fmt::format("{}_iso{}_view{}{}", path.stem().string(), isovalue, view,
                                      path.extension().string()));
  return result;
}

/// Draws one frame; the writing of files asks for what it needs afterwards.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual FrameStats render(const Camera &camera, double isovalue, const OnPass &on_pass) = 0;
  /// Draws the last frame once more, however long it takes.
  virtual FrameStats refine() { return {}; }
  virtual std::vector<HitRecord> hits() = 0;
  virtual Image8 shade() = 0;
  /// Prints what else is known of the frame drawn last, and adds it to its --stats: how far it may
  /// be off, the steps it was drawn in. error_map: the .npy to write, or empty.
  virtual void report(const fs::path & /*error_map*/, nlohmann::ordered_json & /*frame*/) {}
};

/// Prints them, too.
nlohmann::ordered_json timed_steps(const TimedFrame &frame, double budget_ms) {
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  for (const TimedStep &step : frame.steps) {
    fmt::print("  {}x{}, {}: {:.2f} ms, {}\n", step.size.width, step.size.height,
               step.voxel_pixels == 0
                   ? "finest level"
                   : fmt::format("voxels up to {} of its pixels apart", step.voxel_pixels),
               step.ms,
               step.cancelled ? fmt::format("{:.1f} % of it", step.completed_percent) : "whole");
    steps.push_back({{"size", {step.size.width, step.size.height}},
                     {"voxel_pixels", step.voxel_pixels},
                     {"ms", step.ms},
                     {"completed_percent", step.completed_percent},
                     {"cancelled", step.cancelled}});
  }
  return {{"budget_ms", budget_ms}, {"complete", frame.complete}, {"steps", steps}};
}

nlohmann::ordered_json detail_json(const Detail &detail) {
  return {{"voxel_pixels", detail.voxel_pixels}, {"voxel_error", detail.voxel_error}};
}

/// What the errors of a volume's voxels and levels come from, and so what bounds rest on.
std::string_view errors_of(const CompressedVolume &volume) {
  return volume.errors_are_stated ? "stated" : "measured";
}

/// Prints how far a frame of that size may be off, and writes it to error_map, if that is not
/// empty.
nlohmann::ordered_json report_error(double max_surface_error, const CompressedVolume &volume,
                                    const DetailChoice &choice, const Certificate &certificate,
                                    const ImageSize &size, const fs::path &error_map) {
  const CertificateSummary summary = summarize(certificate, max_surface_error);
  const double certified = summary.num_pixels == 0
                               ? 100.0
                               : 100.0 * double(summary.num_certified) / double(summary.num_pixels);
  fmt::print(
      "  within {} pixels of the true surface{}: {:.2f} % of {} rays (bound: median {:.3g}, p99 "
      "{:.3g}); {} "
      "uncertain\n"
      "  with voxels up to {:.3g} pixels apart and values up to {} off; chosen in {:.0f} ms, "
      "bounded in "
      "{:.0f} ms\n",
      max_surface_error,
      volume.errors_are_stated ? ", if the errors are right that the file states" : "", certified,
      with_commas(summary.num_pixels), summary.median, summary.p99,
      with_commas(summary.num_uncertain), choice.detail.voxel_pixels, choice.detail.voxel_error,
      choice.total_ms, certificate.total_ms);
  if (!choice.reachable) {
    warn(fmt::format("most pixels cannot be kept within {} pixels: {}", max_surface_error,
                     choice.advice));
  }
  if (!error_map.empty())
    write_npy({size.ray_columns(), size.ray_rows(), certificate.bounds}, error_map);
  nlohmann::ordered_json tries = nlohmann::ordered_json::array();
  for (const DetailChoice::Try &each : choice.tries) {
    tries.push_back(detail_json(each.detail));
    tries.back()["certified"] = each.certified;
  }
  return {{"max_surface_error", max_surface_error},
          {"errors", errors_of(volume)},
          {"reachable", choice.reachable},
          {"chosen", detail_json(choice.detail)},
          {"tries", tries},
          {"choice_ms", choice.total_ms},
          {"pixels", summary.num_pixels},
          {"certified", summary.num_certified},
          {"uncertain", summary.num_uncertain},
          {"median", summary.median},
          {"p99", summary.p99},
          {"max", summary.max},
          {"bound_ms", certificate.total_ms},
          {"decoded_blocks", certificate.decoded_blocks}};
}

class DeviceFrames : public FrameSource {
 public:
  DeviceFrames(ocl::Device &device, const Scene &scene, const Appearance &appearance,
               const RenderArgs &args)
      : volume_(scene.volume),
        renderer_(device, scene.volume, args.renderer),
        appearance_(appearance),
        max_surface_error_(args.max_surface_error),
        time_budget_(args.time_budget) {
    base_.voxel_pixels = args.voxel_pixels;
    base_.voxel_error = args.frame.voxel_error;
    base_.normals = normals_from_string(args.normals);
    base_.ambient_rays = args.ambient_rays;
    if (time_budget_) timed_frames_.emplace(renderer_);
  }
  FrameStats render(const Camera &camera, double isovalue, const OnPass &on_pass) override {
    request_ = seen_from(camera, base_);
    request_.isovalue = drawn_isovalue(volume_, isovalue);
    if (timed_frames_) {
      timed_ = timed_frames_->render(request_, *time_budget_);
      return timed_.stats;
    }
    if (max_surface_error_) {
      choice_ = choose_detail(renderer_, volume_, request_, *max_surface_error_);
      request_ = with_detail(request_, choice_.detail);
    }
    FrameRequest watched = request_;
    watched.on_pass = on_pass;
    return renderer_.render(watched);
  }
  FrameStats refine() override { return renderer_.render(request_); }
  Camera surface_camera(std::span<const double> isovalues) {
    return renderer_.camera(drawn_isovalues(volume_, isovalues));
  }
  void report(const fs::path &error_map, nlohmann::ordered_json &frame) override {
    if (max_surface_error_) {
      frame["error"] = report_error(*max_surface_error_, volume_, choice_,
                                    certify(renderer_, volume_, request_, renderer_.hits()),
                                    renderer_.options().size, error_map);
    }
    if (timed_frames_) frame["time_budget"] = timed_steps(timed_, *time_budget_);
  }
  std::vector<HitRecord> hits() override { return renderer_.hits(); }
  Image8 shade() override { return renderer_.shade(appearance_); }
  const Renderer &renderer() const { return renderer_; }

 private:
  const CompressedVolume &volume_;
  Renderer renderer_;
  std::optional<TimedFrames> timed_frames_;
  Appearance appearance_;
  std::optional<double> max_surface_error_, time_budget_;
  FrameRequest base_;     ///< of all frames
  FrameRequest request_;  ///< of the last one, as it was drawn
  DetailChoice choice_;
  TimedFrame timed_;
};

class TwinFrames : public FrameSource {
 public:
  TwinFrames(const Scene &scene, const Appearance &appearance, const RenderArgs &args)
      : scene_(scene),
        appearance_(appearance),
        solver_(args.renderer.solver),
        normals_(normals_from_string(args.normals)),
        num_ambient_(args.ambient_rays),
        twin_(scene.volume, args.voxel_pixels, args.frame.voxel_error) {}
  FrameStats render(const Camera &camera, double given, const OnPass &) override {
    const float isovalue = drawn_isovalue(scene_.volume, given);
    const auto begin = Clock::now();
    frame_ = make_frame_params(scene_.volume.info, camera, scene_.size, isovalue);
    hits_ = twin_.render(camera, scene_.size, isovalue, solver_, normals_);
    if (num_ambient_ != 0)
      open_ = twin_.open(camera, scene_.size, isovalue, hits_, num_ambient_, solver_);
    FrameStats stats;
    stats.total_ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
    for (const HitRecord &hit : hits_) stats.rays_hit += std::isfinite(hit.t);
    return stats;
  }
  std::vector<HitRecord> hits() override { return hits_; }
  Image8 shade() override {
    return shade_scalar(frame_, make_shade_params(scene_.volume.info, appearance_), hits_,
                        scene_.size.samples, open_);
  }

 private:
  const Scene &scene_;
  Appearance appearance_;
  Solver solver_;
  Normals normals_;
  std::uint32_t num_ambient_;
  Twin twin_;
  FrameParams frame_{};
  std::vector<HitRecord> hits_;
  OpenCounts open_;
};

void write_outputs(const RenderArgs &options, const Scene &scene, FrameSource &frames,
                   double isovalue, std::size_t view) {
  if (!options.image.empty()) {
    write_png(frames.shade(),
              frame_path(options.image, scene.cameras.size(), options, isovalue, view));
  }
  if (!options.depth.empty()) {
    write_npy({scene.size.ray_columns(), scene.size.ray_rows(), depth_of(frames.hits())},
              frame_path(options.depth, scene.cameras.size(), options, isovalue, view));
  }
}

/// Writes the picture after every pass to --progress-dir, if that was asked for. shade: gives it,
/// or none where this process has none to write.
OnPass progress_writer(const RenderArgs &options, const Scene &scene,
                       const std::function<Image8()> &shade, double isovalue, std::size_t view) {
  if (options.progress_dir.empty()) return {};
  return [&options, &scene, shade, isovalue, view, pass = 0](const PassStats &) mutable {
    const fs::path name = fs::path(options.progress_dir) / fmt::format("pass{:04}.png", ++pass);
    const Image8 image = shade();
    if (!image.pixels.empty())
      write_png(image, frame_path(name, scene.cameras.size(), options, isovalue, view));
    return true;
  };
}

nlohmann::ordered_json draw_frames(const RenderArgs &options, const Scene &scene,
                                   FrameSource &frames) {
  nlohmann::ordered_json result = nlohmann::ordered_json::array();
  for (const double isovalue : options.frame.isovalues) {
    for (std::size_t view = 0; view < scene.cameras.size(); ++view) {
      const Camera &camera = scene.cameras[view];
      const OnPass on_pass = progress_writer(
          options, scene, [&frames] { return frames.shade(); }, isovalue, view);
      const FrameStats stats = frames.render(camera, isovalue, on_pass);
      write_outputs(options, scene, frames, isovalue, view);
      fmt::print("isovalue {}, view {}: {} rays hit, {} passes, {:.1f} ms\n", isovalue, view,
                 with_commas(stats.rays_hit), stats.passes.size(), stats.total_ms);
      warn_of_isovalue(scene.volume, isovalue);
      result.push_back(frame_json(isovalue, view, camera, stats));
      frames.report(frame_path(options.error_map, scene.cameras.size(), options, isovalue, view),
                    result.back());
      if (!options.refined.empty()) {
        const FrameStats refined = frames.refine();
        write_png(frames.shade(),
                  frame_path(options.refined, scene.cameras.size(), options, isovalue, view));
        fmt::print("  refined: {} rays hit, {:.1f} ms more\n", with_commas(refined.rays_hit),
                   refined.total_ms);
      }
    }
  }
  return result;
}

nlohmann::ordered_json options_json(const RenderArgs &options, const Scene &scene) {
  nlohmann::ordered_json json = {{"size", {scene.size.width, scene.size.height}},
                                 {"samples", scene.size.samples},
                                 {"views", scene.cameras.size()},
                                 {"isovalues", options.frame.isovalues},
                                 {"voxel_error", options.frame.voxel_error},
                                 {"reference", options.reference}};
  json.update(renderer_options_json(options.renderer));
  json["voxel_pixels"] = options.voxel_pixels;
  json["normals"] = options.normals;
  json["ambient"] = options.ambient_rays;
  return json;
}

nlohmann::ordered_json volume_json(const RenderArgs &options, const CompressedVolume &volume) {
  const VolumeInfo &info = volume.info;
  return {
      {"file", options.input},
      {"dims", {info.dims.x, info.dims.y, info.dims.z}},
      {"spacing", {info.spacing.x, info.spacing.y, info.spacing.z}},
      {"type", to_string(info.type)},
      {"compression", compression_mode(volume)},
      {"rate", volume.rate()},
      {"max_voxel_error", volume.max_voxel_error ? nlohmann::ordered_json(*volume.max_voxel_error)
                                                 : nlohmann::ordered_json()},
      {"errors", errors_of(volume)},
      {"blocks", volume.block_count()},
      {"stream_bytes", volume.word_count() * sizeof(std::uint32_t)}};
}

/// Outputs go to folders that exist, but for --progress-dir, which is made when frames are drawn.
/// Throws Error before any work.
Outputs check_outputs(const RenderArgs &options, std::size_t num_views) {
  Outputs outputs;
  outputs.read_volume(options.input);
  if (!options.frame.cameras.empty()) outputs.read(options.frame.cameras);
  outputs.write("--stats", options.stats);
  for (const double isovalue : options.frame.isovalues) {
    for (std::size_t view = 0; view < num_views; ++view) {
      const auto write = [&](const char *option, const std::string &name) {
        outputs.write(option, frame_path(name, num_views, options, isovalue, view));
      };
      write("--output", options.image);
      write("--depth", options.depth);
      write("--error-map", options.error_map);
      write("--refined", options.refined);
    }
  }
  outputs.write_pictures("--progress-dir", options.progress_dir, "pass");
  for (const std::string &name : {options.image, options.refined}) check_png_name(name);
  for (const std::string &name : {options.depth, options.error_map}) check_npy_name(name);
  check_json_name(options.stats);
  return outputs;
}

std::unique_ptr<ocl::Device> open_device(const RenderArgs &options, const ocl::DeviceInfo &info) {
  fmt::print("device {}: {} ({}); choose another with --device or ISOWAVE_DEVICE\n", info.index,
             info.name, info.platform);
  return std::make_unique<ocl::Device>(info, !options.stats.empty() && !options.no_stage_times);
}

void print_plan(const MemoryPlan &plan, const CompressedVolume &volume) {
  fmt::print("the compressed volume of {} bytes stays on the {}: {}\n",
             with_commas(volume.word_count() * sizeof(std::uint32_t)), to_string(plan.stream),
             plan.reason);
  if (plan.stream == StreamPlace::kHost) {
    fmt::print("its blocks are uploaded through a window, {} at a time\n",
               with_commas(plan.window_blocks));
  }
  for (const ocl::BufferSize &buffer : plan.buffers) {
    fmt::print("  {:>16} bytes  {}\n", with_commas(buffer.bytes()), buffer.name);
  }
  fmt::print("  {:>16} bytes  in all, with {} cache slots; at most {} during setup\n",
             with_commas(plan.total()), with_commas(plan.cache_slots),
             with_commas(plan.setup_bytes));
  if (plan.can_grow()) {
    fmt::print("  {:>16} bytes  at most, should frames need more slots: with {}\n",
               with_commas(resized(plan, plan.most_slots).total()), with_commas(plan.most_slots));
  }
}

/// --max-surface-error, --time-budget and what goes with them.
void check_choice(const RenderArgs &options) {
  if (!options.max_surface_error && !options.error_map.empty())
    throw Error("--error-map needs --max-surface-error");
  if (!options.time_budget && !options.refined.empty())
    throw Error("--refined needs --time-budget");
  if (!options.max_surface_error && !options.time_budget) return;
  const char *choice = options.max_surface_error ? "--max-surface-error" : "--time-budget";
  if (options.reference) throw Error("--reference cannot choose: leave out {}", choice);
  if (options.time_budget) check_time_budget(*options.time_budget);
  if (options.time_budget && !options.progress_dir.empty())
    throw Error("--time-budget draws a frame in steps: leave out --progress-dir");
  if (!options.max_surface_error) return;
  check_max_surface_error(*options.max_surface_error);
  if (options.time_budget)
    throw Error("--max-surface-error takes the time it takes: leave out --time-budget");
  if (options.frame.voxel_error > 0 || options.voxel_pixels > 0)
    throw Error(
        "--max-surface-error chooses for itself: leave out --voxel-error and --voxel-pixels");
}

/// What can be told from the options alone.
void check_options(const CLI::App &command, const RenderArgs &options) {
  if (options.reference && !options.progress_dir.empty())
    throw Error("--reference has no passes: leave out --progress-dir");
  if (options.image.empty() && options.refined.empty() && options.progress_dir.empty())
    refuse_options(command, {"--color", "--background", "--normals", "--ambient"},
                   "no picture is written: give --output");
  if (options.stats.empty())
    refuse_options(command, {"--no-stage-times"}, "no statistics are written: give --stats");
  check_renderer_options(command, options.renderer_flags);
  check_ambient_rays(options.ambient_rays);
  with_fewer_planes({}, options.frame.voxel_error);  // or throws
  check_voxel_pixels(options.voxel_pixels);
  check_choice(options);
}

/// Whoever chooses has levels of detail to choose from.
bool chooses_levels(const RenderArgs &options) {
  return options.max_surface_error ||
         (options.time_budget && options.renderer_flags.pipeline != "blocks");
}

/// The view that any device would take. Without a device, of the whole volume.
Camera reference_camera(const RenderArgs &options, const Scene &scene) {
  if (ocl::list_devices().empty()) return scene.cameras.front();
  ocl::Device device(ocl::choose_device());
  return surface_camera(device, scene.volume,
                        drawn_isovalues(scene.volume, options.frame.isovalues), scene.size);
}

/// Whether a file was asked for.
bool asks_for_output(const RenderArgs &options) {
  for (const std::string *name : {&options.image, &options.depth, &options.stats,
                                  &options.progress_dir, &options.error_map, &options.refined}) {
    if (!name->empty()) return true;
  }
  return false;
}

/// VOLUME_iso40.png, in the current folder; of several frames, frame_path() says the rest.
std::string default_image(const RenderArgs &options, std::size_t num_views) {
  const std::string stem = volume_stem(options.input);
  if (num_views * options.frame.isovalues.size() > 1) return stem + ".png";
  return fmt::format("{}_iso{}.png", stem, options.frame.isovalues.front());
}

void print_picture_name(const RenderArgs &options, std::size_t num_views) {
  fmt::print("wrote {}; --output names another file\n",
             num_views * options.frame.isovalues.size() == 1
                 ? options.image
                 : fmt::format("{}_isoV_viewK.png", volume_stem(options.input)));
}

/// Refuses options that bricks cannot serve.
void check_brick_options(const CLI::App &command, const Team &team) {
  refuse_options(command, {"--reference", "--verbose"},
                 fmt::format("cannot be used with mpirun: {} processes draw parts of the volume",
                             team.size()));
}

/// Throws Error where one process would make levels of detail. levels: that the volume has.
void check_brick_levels(const RenderArgs &options, const std::vector<VolumeInfo> &levels) {
  if (levels.size() > 1 || max_levels(levels.front().dims) == 1) return;
  const CompressionOptions &compression = options.frame.compression;
  const bool makes_levels =
      !is_zfp_name(options.input) &&
      (compression.levels != 1 || (options.max_surface_error && !says_levels(compression)));
  if (options.voxel_pixels == 0 && !makes_levels) return;
  throw Error(
      "{} has no levels of detail, which bricks cannot make: isowave convert --levels all{}",
      options.input, options.max_surface_error ? ", or do without them: --levels 1" : "");
}

/// All ranks: writes what rank 0 has got.
void write_brick_outputs(const RenderArgs &options, const Scene &scene,
                         const Appearance &appearance, BrickRenderer &renderer, Team &team,
                         double isovalue, std::size_t view) {
  const std::size_t num_views = scene.cameras.size();
  Image8 image;
  std::vector<float> depth;
  if (!options.depth.empty() || options.image.empty()) depth = renderer.depth();
  if (!options.image.empty()) image = renderer.shade(appearance);
  together(team, [&] {
    if (team.rank() != 0) return;
    if (!options.image.empty())
      write_png(image, frame_path(options.image, num_views, options, isovalue, view));
    if (!options.depth.empty()) {
      write_npy({scene.size.ray_columns(), scene.size.ray_rows(), std::move(depth)},
                frame_path(options.depth, num_views, options, isovalue, view));
    }
  });
}

/// Each step is as complete as the rank that has got least far.
TimedFrame within_time(BrickRenderer &renderer, Team &team, const FrameRequest &request,
                       double budget_ms) {
  TimedFrame frame = renderer.render_within(request, budget_ms);
  std::vector<double> own;
  for (const TimedStep &step : frame.steps) own.push_back(step.completed_percent);
  const std::vector<double> all = gather(team, own);
  for (std::size_t i = 0; i < all.size(); ++i) {
    double &percent = frame.steps[i % own.size()].completed_percent;
    percent = std::min(percent, all[i]);
  }
  return frame;
}

/// --refined: draws the frame once more, however long that takes.
void write_refined(const RenderArgs &options, const Scene &scene, const Appearance &appearance,
                   BrickRenderer &renderer, Team &team, const FrameRequest &request,
                   double isovalue, std::size_t view) {
  const FrameStats refined = renderer.render(request);
  const Image8 image = renderer.shade(appearance);
  together(team, [&] {
    if (team.rank() != 0) return;
    write_png(image, frame_path(options.refined, scene.cameras.size(), options, isovalue, view));
  });
  fmt::print("  refined: {} rays hit, {:.1f} ms more\n", with_commas(renderer.num_hits()),
             refined.total_ms);
}

/// Draws a volume's bricks, one at each rank. frames: of the whole, at rank 0; own: this rank's.
/// bounded: of --max-surface-error.
void draw_brick_frames(const RenderArgs &options, const Scene &scene, const CompressedVolume &brick,
                       const Appearance &appearance, BrickRenderer &renderer,
                       std::optional<FramesOfTeam> &bounded, Team &team,
                       nlohmann::ordered_json &frames, nlohmann::ordered_json &own) {
  FrameRequest base;
  base.voxel_pixels = options.voxel_pixels;
  base.voxel_error = options.frame.voxel_error;
  base.normals = normals_from_string(options.normals);
  base.ambient_rays = options.ambient_rays;
  for (const double isovalue : options.frame.isovalues) {
    for (std::size_t view = 0; view < scene.cameras.size(); ++view) {
      const Camera &camera = scene.cameras[view];
      const auto begin = Clock::now();
      const double composed_before = renderer.composition().ms;
      FrameRequest request = seen_from(camera, base);
      request.isovalue = drawn_isovalue(brick, isovalue);
      request.on_pass = progress_writer(
          options, scene, [&] { return renderer.shade(appearance); }, isovalue, view);
      DetailChoice choice;
      if (bounded) {
        choice = choose_detail(*bounded, request, *options.max_surface_error);
        request = with_detail(request, choice.detail);
      }
      renderer.check_levels(request);
      TimedFrame timed;
      if (options.time_budget) {
        timed = within_time(renderer, team, request, *options.time_budget);
      } else {
        timed.stats = renderer.render(request);
      }
      write_brick_outputs(options, scene, appearance, renderer, team, isovalue, view);
      own.push_back(frame_json(isovalue, view, camera, timed.stats));
      const double ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
      fmt::print("isovalue {}, view {}: {} rays hit, {} bricks, {:.1f} ms\n", isovalue, view,
                 with_commas(renderer.num_hits()), team.size(), ms);
      warn_of_isovalue(brick, isovalue);
      frames.push_back({{"isovalue", isovalue},
                        {"view", view},
                        {"rays_hit", renderer.num_hits()},
                        {"written_ms", ms},
                        {"composition_ms", renderer.composition().ms - composed_before}});
      if (bounded) {
        const Certificate certificate = certify(*bounded, request, renderer.depth());
        together(team, [&] {
          if (team.rank() != 0) return;
          frames.back()["error"] = report_error(
              *options.max_surface_error, brick, choice, certificate, scene.size,
              frame_path(options.error_map, scene.cameras.size(), options, isovalue, view));
        });
      }
      if (options.time_budget)
        frames.back()["time_budget"] = timed_steps(timed, *options.time_budget);
      if (!options.refined.empty())
        write_refined(options, scene, appearance, renderer, team, request, isovalue, view);
    }
  }
}

void render_bricks(const CLI::App &command, RenderArgs options, Team &team) {
  options.voxel_pixels = options.renderer_flags.voxel_pixels;
  agree_on(team, "version", program_name());
  agree_on(team, "command line", MpiJob::command_line());
  check_brick_options(command, team);
  const bool names_picture = !asks_for_output(options);
  const Views views = read_views(options.frame);
  if (names_picture) options.image = default_image(options, views.count);
  check_options(command, options);
  Appearance appearance;
  appearance.surface = parse_color("--color", options.color);
  appearance.background = parse_color("--background", options.background);
  TeamVolumeSource source;
  source.path = options.input;
  source.overrides = to_overrides(options.volume);
  source.bricks = options.bricks;
  source.isovalues.assign(options.frame.isovalues.begin(), options.frame.isovalues.end());
  RendererOptions &wanted = options.renderer_flags.values;
  wanted.with_shading =
      !options.image.empty() || !options.progress_dir.empty() || !options.refined.empty();
  wanted.with_kept_picture = options.time_budget.has_value();
  wanted.with_given_rays = options.ambient_rays != 0;
  wanted.with_bounds = options.max_surface_error.has_value();
  options.frame.compression.measure_error |= wanted.with_bounds;
  if (!wanted.with_shading) options.normals = to_string(Normals::kCell);  // no picture shows them
  Scene scene;
  scene.size = views.size;
  std::unique_ptr<ocl::Device> device;
  Outputs outputs;
  together(team, [&] {
    if (team.rank() == 0) outputs = check_outputs(options, views.count);
    device = open_device(options, choose_local_device(options.device, MpiJob::local_rank()));
    source.storage = storage_for(options.input, options.frame.compression, device.get());
    options.renderer = to_renderer_options(options.renderer_flags, scene.size);
  });
  const TeamVolume volume = open_together(team, source, [&](std::vector<VolumeInfo> &levels) {
    if (!is_zfp_name(options.input)) warn_of_header(options.input, source.overrides);
    check_brick_levels(options, levels);
    if (options.voxel_pixels == 0 && !chooses_levels(options)) levels.resize(1);
    scene.cameras = make_cameras(options.input, levels.front(), options.frame, views);
  });
  const VolumeInfo &whole = volume.whole();
  const BlockBox &own = volume.cuts.bricks()[team.rank()];
  std::optional<BrickRenderer> renderer;
  together(team, [&] {
    outputs.make_folder();
    renderer.emplace(*device, volume, options.renderer, team);
  });
  std::optional<FramesOfTeam> bounded;
  if (wanted.with_bounds) bounded.emplace(*renderer, volume.brick, volume.rate);
  if (options.frame.orbit == 0 && options.frame.cameras.empty()) {
    scene.cameras = {surface_camera(
        whole,
        gather_box(team, volume.brick.info,
                   renderer->surface_box(drawn_isovalues(volume.brick, options.frame.isovalues))),
        scene.size)};
  }
  nlohmann::ordered_json frames = nlohmann::ordered_json::array(), own_frames = frames;
  draw_brick_frames(options, scene, volume.brick, appearance, *renderer, bounded, team, frames,
                    own_frames);
  const CompositionStats &composition = renderer->composition();
  const nlohmann::ordered_json of_rank = {{"rank", team.rank()},
                                          {"device", device_json(device->info())},
                                          {"brick",
                                           {{"begin", {own.begin.x, own.begin.y, own.begin.z}},
                                            {"end", {own.end.x, own.end.y, own.end.z}}}},
                                          {"volume", volume_json(options, volume.brick)},
                                          {"setup_ms", renderer->renderer().setup_ms()},
                                          {"compile_ms", device->compile_ms()},
                                          {"composition",
                                           {{"reductions", composition.reductions},
                                            {"bytes", composition.bytes},
                                            {"ms", composition.ms}}},
                                          {"frames", own_frames},
                                          {"memory", memory_json(device->ledger())}};
  const std::vector<std::string> of_ranks = team.all_gather(json_text(of_rank));
  together(team, [&] {
    if (team.rank() != 0 || options.stats.empty()) return;
    RenderArgs shown = options;
    shown.renderer = renderer->renderer().options();
    nlohmann::ordered_json ranks = nlohmann::ordered_json::array();
    for (const std::string &text : of_ranks) ranks.push_back(nlohmann::ordered_json::parse(text));
    write_json({{"program", program_name()},
                {"volume",
                 {{"file", options.input},
                  {"dims", {whole.dims.x, whole.dims.y, whole.dims.z}},
                  {"spacing", {whole.spacing.x, whole.spacing.y, whole.spacing.z}},
                  {"type", to_string(whole.type)},
                  {"blocks", num_blocks({glm::ivec3(0), blocks_along(whole)})}}},
                {"options", options_json(shown, scene)},
                {"frames", frames},
                {"ranks", ranks}},
               options.stats);
  });
  if (names_picture) print_picture_name(options, views.count);
}

void run_render(const CLI::App &command, RenderArgs options) {
  if (Team *team = MpiJob::team()) return render_bricks(command, std::move(options), *team);
  refuse_options(command, {"--bricks"}, "one process draws the whole: start more by mpirun");
  options.voxel_pixels = options.renderer_flags.voxel_pixels;
  const bool names_picture = !asks_for_output(options);
  const Views views = read_views(options.frame);
  if (names_picture) options.image = default_image(options, views.count);
  check_options(command, options);
  Appearance appearance;
  appearance.surface = parse_color("--color", options.color);
  appearance.background = parse_color("--background", options.background);
  const Outputs outputs = check_outputs(options, views.count);
  const std::unique_ptr<ocl::Device> device =
      options.reference ? nullptr : open_device(options, ocl::choose_device(options.device));
  std::optional<CompileReport> compiling;
  if (device) compiling.emplace(*device);
  RendererOptions &wanted = options.renderer_flags.values;
  options.frame.compression.measure_error |= options.max_surface_error.has_value();
  wanted.with_bounds = options.max_surface_error.has_value();
  wanted.with_kept_picture = options.time_budget.has_value();
  wanted.with_given_rays = options.ambient_rays != 0;
  wanted.with_shading =
      !options.image.empty() || !options.progress_dir.empty() || !options.refined.empty();
  if (!wanted.with_shading) options.normals = to_string(Normals::kCell);  // nobody sees them
  if (options.voxel_pixels > 0 || chooses_levels(options)) want_levels(options.frame.compression);
  Scene scene = load_scene(options.input, options.volume, options.frame, views, device.get());
  print_compression(options.input, scene.volume);
  outputs.make_folder();
  wanted.with_levels = chooses_levels(options) && !scene.volume.coarser_levels.empty();
  options.renderer = to_renderer_options(options.renderer_flags, scene.size);
  nlohmann::ordered_json document = {{"program", program_name()},
                                     {"volume", volume_json(options, scene.volume)}};
  const bool fits_surface = options.frame.orbit == 0 && options.frame.cameras.empty();
  if (!device) {
    if (fits_surface) scene.cameras = {reference_camera(options, scene)};
    TwinFrames frames(scene, appearance, options);
    document["options"] = options_json(options, scene);
    document["frames"] = draw_frames(options, scene, frames);
  } else {
    DeviceFrames frames(*device, scene, appearance, options);
    compiling->finish();
    options.renderer = frames.renderer().options();
    if (fits_surface) scene.cameras = {frames.surface_camera(options.frame.isovalues)};
    if (options.verbose) print_plan(frames.renderer().memory_plan(), scene.volume);
    document["device"] = device_json(device->info());
    document["options"] = options_json(options, scene);
    document["setup_ms"] = frames.renderer().setup_ms();
    document["compile_ms"] = device->compile_ms();
    document["frames"] = draw_frames(options, scene, frames);
    const MemoryPlan &plan = frames.renderer().memory_plan();
    document["cache_slots"] = {{"first", options.renderer.cache_slots},
                               {"last", plan.cache_slots},
                               {"most", plan.most_slots}};
    document["memory"] = memory_json(device->ledger());
    fmt::print("setup {:.0f} ms; device memory: peak {:.1f} MiB\n", frames.renderer().setup_ms(),
               double(device->ledger().peak()) / (1 << 20));
  }
  if (!options.stats.empty()) write_json(document, options.stats);
  if (names_picture) print_picture_name(options, views.count);
}

}  // namespace

/// Options of every day come first, those of researchers last.
void group_render_options(CLI::App &command) {
  group_options(command, "Options of every day",
                {"--help", "--isovalue", "--output", "--size", "--samples", "--orbit", "--cameras",
                 "--color", "--background", "--normals", "--ambient", "--device"});
  group_volume_options(command);
  group_compression_options(command);
  group_options(command, "Precision and time",
                {"--voxel-pixels", "--voxel-error", "--max-surface-error", "--error-map",
                 "--time-budget", "--refined"});
  group_options(command, "Memory", {"--memory-budget", "--cache-slots", "--stream", "--verbose"});
  group_options(command, "Several processes, by mpirun", {"--bricks"});
  group_options(command, "Further outputs",
                {"--depth", "--stats", "--no-stage-times", "--progress-dir"});
  group_options(command, "For researchers",
                {"--reference", "--pipeline", "--speculation", "--max-speculation", "--solver",
                 "--grouping", "--closest", "--group-size"});
}

void add_render(CLI::App &app) {
  CLI::App *command =
      app.add_subcommand("render", "Draw isosurfaces: PNG pictures, depth and statistics");
  const auto options = std::make_shared<RenderArgs>();
  command->add_option("VOLUME", options->input, "a .zfp file, or " + std::string(kVolumeHelp))
      ->required();
  add_volume_options(*command, options->volume);
  add_frame_options(*command, options->frame)->required();
  command
      ->add_option("--samples", options->frame.samples,
                   "N: a pixel is the mean of N x N rays; pixels elsewhere in this list are still "
                   "the picture's")
      ->check(CLI::Range(1u, ImageSize::kMaxSamples))
      ->capture_default_str();
  command->add_option("--device", options->device,
                      "device: index, cpu, gpu, or a part of its name (see `isowave devices`); "
                      "several, with commas: of the first process of a host, the second, ...");
  command->add_option("--bricks", options->bricks,
                      "how to cut the volume, one brick per process: XxYxZ bricks along each axis, "
                      "or active to give each brick the same number of surface blocks [bricks of "
                      "equal size]");
  command->add_option("--color", options->color, "surface colour #RRGGBB")->capture_default_str();
  command->add_option("--background", options->background, "background colour #RRGGBB")
      ->capture_default_str();
  add_normals_option(*command, options->normals);
  add_ambient_option(*command, options->ambient_rays);
  command->add_option("--output,-o", options->image,
                      "PNG; NAME_isoV_viewK.png when there are several frames [VOLUME_isoV.png in "
                      "the current folder, where no other output is asked for]");
  command->add_option("--depth", options->depth,
                      "float32 .npy [H,W]: distance from the eye, inf where nothing is hit; with "
                      "--samples of each ray");
  command->add_option(
      "--max-surface-error", options->max_surface_error,
      "choose levels of detail and bit planes for each frame, so that its surface is within so "
      "many pixels of the true one, and say for how many pixels that is certain");
  command->add_option(
      "--error-map", options->error_map,
      "float32 .npy [H,W] of --max-surface-error: the bound of each pixel, or ray, inf "
      "where there is none");
  command->add_option(
      "--time-budget", options->time_budget,
      "ms for each frame: draws small pictures by coarse levels of detail first, then larger ones, "
      "as long as there is time");
  command->add_option("--refined", options->refined,
                      "PNG of --time-budget: the whole picture, drawn after the other");
  command->add_option("--stats", options->stats, "JSON statistics of every frame and pass");
  command->add_flag(
      "--no-stage-times", options->no_stage_times,
      "leave ms per stage out of --stats: measuring them makes the host wait after each pass");
  command->add_flag("--verbose", options->verbose, "print the plan of the device's memory");
  command->add_option("--progress-dir", options->progress_dir,
                      "folder for the picture after every pass");
  add_renderer_options(*command, options->renderer_flags);
  command->add_flag(
      "--reference", options->reference,
      "use the scalar C++ reference instead of a device; options of how a device draws are "
      "then without effect");
  command->get_option("--orbit")->description(
      "draw N views around the whole volume [one, which the surfaces fill]");
  group_render_options(*command);
  command->callback([command, options] { run_render(*command, *options); });
}

}  // namespace isowave::core::tools
