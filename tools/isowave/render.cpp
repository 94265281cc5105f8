// isowave render: pictures, depth and statistics of isosurfaces, on an OpenCL device or by the scalar twin.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include "core/detail.hpp"
#include "core/error.hpp"
#include "core/io/npy.hpp"
#include "core/renderer.hpp"
#include "reference/twin.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/renderer_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::tools {

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
  std::string image, depth, stats, progress_dir;
};

/// "#RRGGBB" -> [0,1]^3.
glm::vec3 parse_color(const char *option, const std::string &text) {
  std::uint32_t rgb = 0;
  const char *end = text.data() + text.size();
  if (text.size() == 7 && text[0] == '#') {
    const auto parsed = std::from_chars(text.data() + 1, end, rgb, 16);
    if (parsed.ec == std::errc{} && parsed.ptr == end) {
      return {float(rgb >> 16) / 255.0f, float(rgb >> 8 & 255u) / 255.0f, float(rgb & 255u) / 255.0f};
    }
  }
  throw Error("{} {}: give a colour as #RRGGBB", option, text);
}

/// Where a frame's file goes: the name as given for a single frame, else NAME_isoV_viewK.EXT.
fs::path frame_path(const fs::path &path, const Scene &scene, const RenderArgs &options, float isovalue,
                    std::size_t view) {
  if (scene.cameras.size() * options.frame.isovalues.size() == 1) return path;
  fs::path result = path;
  result.replace_filename(
      fmt::format("{}_iso{}_view{}{}", path.stem().string(), isovalue, view, path.extension().string()));
  return result;
}

/// Draws one frame; the writing of files asks for what it needs afterwards.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual FrameStats render(const Camera &camera, float isovalue, const OnPass &on_pass) = 0;
  virtual std::vector<HitRecord> hits() = 0;
  virtual Image8 shade() = 0;
};

class DeviceFrames : public FrameSource {
 public:
  DeviceFrames(ocl::Device &device, const Scene &scene, const Appearance &appearance,
               const RendererOptions &options, double value_error)
      : renderer_(device, scene.volume, options), appearance_(appearance) {
    renderer_.set_value_error(value_error);
  }
  FrameStats render(const Camera &camera, float isovalue, const OnPass &on_pass) override {
    return renderer_.render(camera, isovalue, on_pass);
  }
  std::vector<HitRecord> hits() override { return renderer_.hits(); }
  Image8 shade() override { return renderer_.shade(appearance_); }
  const Renderer &renderer() const { return renderer_; }

 private:
  Renderer renderer_;
  Appearance appearance_;
};

class TwinFrames : public FrameSource {
 public:
  TwinFrames(const Scene &scene, const Appearance &appearance, const RendererOptions &options,
             double value_error)
      : scene_(scene),
        appearance_(appearance),
        options_(options),
        twin_(scene.volume, options.max_pixel_error, value_error) {}
  FrameStats render(const Camera &camera, float isovalue, const OnPass &) override {
    const auto begin = Clock::now();
    frame_ = make_frame_params(scene_.volume.info, camera, scene_.size, isovalue);
    hits_ = twin_.render(camera, scene_.size, isovalue, options_.solver);
    FrameStats stats;
    stats.total_ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
    for (const HitRecord &hit : hits_) stats.rays_hit += std::isfinite(hit.t);
    return stats;
  }
  std::vector<HitRecord> hits() override { return hits_; }
  Image8 shade() override {
    return shade_scalar(frame_, make_shade_params(scene_.volume.info, appearance_), hits_);
  }

 private:
  const Scene &scene_;
  Appearance appearance_;
  RendererOptions options_;
  Twin twin_;
  FrameParams frame_{};
  std::vector<HitRecord> hits_;
};

void write_outputs(const RenderArgs &options, const Scene &scene, FrameSource &frames, float isovalue,
                   std::size_t view) {
  if (!options.image.empty()) {
    write_png(frames.shade(), frame_path(options.image, scene, options, isovalue, view));
  }
  if (!options.depth.empty()) {
    write_npy({scene.size.width, scene.size.height, depth_of(frames.hits())},
              frame_path(options.depth, scene, options, isovalue, view));
  }
}

/// Writes the picture after every pass to --progress-dir, if that was asked for.
OnPass progress_writer(const RenderArgs &options, const Scene &scene, FrameSource &frames, float isovalue,
                       std::size_t view) {
  if (options.progress_dir.empty()) return {};
  return [&options, &scene, &frames, isovalue, view, pass = 0](const PassStats &) mutable {
    const fs::path name = fs::path(options.progress_dir) / fmt::format("pass{:04}.png", ++pass);
    write_png(frames.shade(), frame_path(name, scene, options, isovalue, view));
    return true;
  };
}

nlohmann::ordered_json draw_frames(const RenderArgs &options, const Scene &scene, FrameSource &frames) {
  nlohmann::ordered_json result = nlohmann::ordered_json::array();
  for (const float isovalue : options.frame.isovalues) {
    for (std::size_t view = 0; view < scene.cameras.size(); ++view) {
      const Camera &camera = scene.cameras[view];
      const FrameStats stats =
          frames.render(camera, isovalue, progress_writer(options, scene, frames, isovalue, view));
      write_outputs(options, scene, frames, isovalue, view);
      fmt::print("isovalue {}, view {}: {} rays hit, {} passes, {:.1f} ms\n", isovalue, view,
                 with_commas(stats.rays_hit), stats.passes.size(), stats.total_ms);
      result.push_back(frame_json(isovalue, view, camera, stats));
    }
  }
  return result;
}

nlohmann::ordered_json options_json(const RenderArgs &options, const Scene &scene) {
  nlohmann::ordered_json json = {{"size", {scene.size.width, scene.size.height}},
                                 {"views", scene.cameras.size()},
                                 {"isovalues", options.frame.isovalues},
                                 {"value_error", options.frame.value_error},
                                 {"reference", options.reference}};
  json.update(renderer_options_json(options.renderer));
  return json;
}

nlohmann::ordered_json volume_json(const RenderArgs &options, const CompressedVolume &volume) {
  const VolumeInfo &info = volume.info;
  return {
      {"file", options.input},
      {"dims", {info.dims.x, info.dims.y, info.dims.z}},
      {"spacing", {info.spacing.x, info.spacing.y, info.spacing.z}},
      {"type", to_string(info.type)},
      {"rate", volume.rate()},
      {"max_error", volume.max_error ? nlohmann::ordered_json(*volume.max_error) : nlohmann::ordered_json()},
      {"blocks", volume.block_count()},
      {"stream_bytes", volume.word_count() * sizeof(std::uint32_t)}};
}

/// Outputs go to folders that exist, but for --progress-dir, which is made. Found out before any work is
/// done.
void check_outputs(const RenderArgs &options) {
  for (const std::string &output : {options.image, options.depth, options.stats}) {
    const fs::path folder = fs::path(output).parent_path();
    if (!folder.empty() && !fs::is_directory(folder))
      throw Error("cannot write {}: {} is no folder", output, folder.string());
    if (fs::is_directory(output)) throw Error("cannot write {}: it is a folder", output);
  }
  if (options.progress_dir.empty()) return;
  std::error_code failure;
  fs::create_directories(options.progress_dir, failure);
  if (failure) throw Error("cannot make the folder {}: {}", options.progress_dir, failure.message());
}

std::unique_ptr<ocl::Device> open_device(const RenderArgs &options) {
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({}); choose another with --device or ISOWAVE_DEVICE\n", info.index, info.name,
             info.platform);
  if (!info.capabilities.correctly_rounded_divide) {
    spdlog::warn(
        "{} does not promise correctly rounded division: pictures may differ from other devices' in last "
        "bits",
        info.name);
  }
  return std::make_unique<ocl::Device>(info, !options.stats.empty() && !options.no_stage_times);
}

void print_plan(const MemoryPlan &plan, const CompressedVolume &volume) {
  fmt::print("the compressed volume of {} bytes stays on the {}: {}\n",
             with_commas(volume.word_count() * sizeof(std::uint32_t)), to_string(plan.stream), plan.reason);
  if (plan.stream == StreamPlace::kHost) {
    fmt::print("its blocks are uploaded through a window, {} at a time\n", with_commas(plan.window_blocks));
  }
  for (const MemoryPlan::Buffer &buffer : plan.buffers) {
    fmt::print("  {:>16} bytes  {}\n", with_commas(buffer.bytes), buffer.name);
  }
  fmt::print("  {:>16} bytes  in all, with {} cache slots; at most {} during setup\n",
             with_commas(plan.total()), with_commas(plan.cache_slots), with_commas(plan.setup_bytes));
}

void run_render(RenderArgs options) {
  if (options.reference && !options.progress_dir.empty())
    throw Error("--reference has no passes: leave out --progress-dir");
  for (const float isovalue : options.frame.isovalues) {
    if (std::isnan(isovalue)) throw Error("--isovalue nan: give a number in the volume's value range");
  }
  coarser({}, options.frame.value_error);  // or throws
  check_max_pixel_error(options.renderer_flags.values.max_pixel_error);
  check_outputs(options);
  Appearance appearance;
  appearance.surface = parse_color("--color", options.color);
  appearance.background = parse_color("--background", options.background);
  const std::unique_ptr<ocl::Device> device = options.reference ? nullptr : open_device(options);
  want_levels(options.renderer_flags, options.frame.compression);
  const Scene scene = load_scene(options.input, options.volume, options.frame, device.get());
  options.renderer = to_renderer_options(options.renderer_flags, scene.size);
  nlohmann::ordered_json document = {{"program", "isowave 0.1.0"},
                                     {"volume", volume_json(options, scene.volume)}};
  if (!device) {
    TwinFrames frames(scene, appearance, options.renderer, options.frame.value_error);
    document["options"] = options_json(options, scene);
    document["frames"] = draw_frames(options, scene, frames);
  } else {
    DeviceFrames frames(*device, scene, appearance, options.renderer, options.frame.value_error);
    options.renderer = frames.renderer().options();
    if (options.verbose) print_plan(frames.renderer().memory_plan(), scene.volume);
    document["device"] = device_json(device->info());
    document["options"] = options_json(options, scene);
    document["setup_ms"] = frames.renderer().setup_ms();
    document["frames"] = draw_frames(options, scene, frames);
    document["memory"] = memory_json(device->ledger());
    fmt::print("setup {:.0f} ms; device memory: peak {:.1f} MiB\n", frames.renderer().setup_ms(),
               double(device->ledger().peak()) / (1 << 20));
  }
  if (!options.stats.empty()) write_json(document, options.stats);
}

}  // namespace

void add_render(CLI::App &app) {
  CLI::App *command = app.add_subcommand("render", "Draw isosurfaces: PNG pictures, depth and statistics");
  const auto options = std::make_shared<RenderArgs>();
  command->add_option("VOLUME", options->input, "a .zfp file, or " + std::string(kVolumeHelp))->required();
  add_volume_options(*command, options->volume);
  add_frame_options(*command, options->frame)->required();
  command->add_option("--device", options->device,
                      "device: index, cpu, gpu, or a part of its name (see `isowave devices`)");
  add_renderer_options(*command, options->renderer_flags);
  command->add_flag("--reference", options->reference, "use the scalar C++ reference instead of a device");
  command->add_option("--color", options->color, "surface colour #RRGGBB")->capture_default_str();
  command->add_option("--background", options->background, "background colour #RRGGBB")
      ->capture_default_str();
  command->add_option("--output,-o", options->image,
                      "PNG; NAME_isoV_viewK.png when there are several frames");
  command->add_option("--depth", options->depth,
                      "float32 .npy [H,W]: distance from the eye, inf where nothing is hit");
  command->add_option("--stats", options->stats, "JSON statistics of every frame and pass");
  command->add_flag("--no-stage-times", options->no_stage_times,
                    "leave ms per stage out of --stats: measuring them makes the host wait after each pass");
  command->add_flag("--verbose", options->verbose, "print the plan of the device's memory");
  command->add_option("--progress-dir", options->progress_dir, "folder for the picture after every pass");
  command->callback([options] { run_render(*options); });
}

}  // namespace isowave::tools
