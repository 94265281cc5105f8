// frame_bench: whole frames of one volume from an orbit of cameras. Total times without profiling; a second
// run with profiling gives the milliseconds per stage.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <exception>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <utility>

#include "bench/frame_report.hpp"
#include "bench/run_info.hpp"
#include "core/error.hpp"
#include "core/renderer.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::bench {

namespace {

struct Options {
  std::string volume, device, json;
  std::string solver{to_string(kDefaultSolver)}, grouping{to_string(kDefaultGrouping)};
  tools::VolumeOptions volume_options;
  std::optional<float> isovalue;
  std::uint32_t rate = 4, orbit = 10, rounds = 3;
  std::vector<std::uint32_t> size = {1280, 720};
  RendererOptions renderer;
};

/// The one asked for, or the middle of the volume's values.
float isovalue_of(const Options &options, const CompressedVolume &volume) {
  if (options.isovalue) return *options.isovalue;
  const float middle = 0.5f * volume.value_range[0] + 0.5f * volume.value_range[1];
  if (!std::isfinite(middle))
    throw Error("{} does not say its range of values: give --isovalue", options.volume);
  return middle;
}

/// The camera one degree further around the vertical through the point it looks at.
Camera turned(Camera camera) {
  const glm::dquat turn = glm::angleAxis(glm::radians(1.0), glm::normalize(camera.up));
  camera.eye = camera.at + turn * (camera.eye - camera.at);
  return camera;
}

std::vector<ViewTimes> measure_views(Renderer &renderer, const std::vector<Camera> &cameras, float isovalue,
                                     std::uint32_t rounds) {
  // A driver may compile a kernel when it first runs; the first frame also finds the isovalue's blocks.
  renderer.render(cameras.front(), isovalue);
  std::vector<ViewTimes> views(cameras.size());
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (std::size_t view = 0; view < cameras.size(); ++view) {
      renderer.clear_cache();
      views[view].cold.push_back(renderer.render(cameras[view], isovalue));
      views[view].warm.push_back(renderer.render(cameras[view], isovalue));
      views[view].next.push_back(renderer.render(turned(cameras[view]), isovalue));
    }
  }
  return views;
}

/// Stage -> ms of a cold frame, for each view.
std::vector<std::map<std::string, double>> measure_stages(ocl::Device &device, Renderer &renderer,
                                                          const std::vector<Camera> &cameras,
                                                          float isovalue) {
  renderer.render(cameras.front(), isovalue);
  std::vector<std::map<std::string, double>> views(cameras.size());
  for (std::size_t view = 0; view < cameras.size(); ++view) {
    renderer.clear_cache();
    device.timer().collect();  // what clearing took
    for (const PassStats &pass : renderer.render(cameras[view], isovalue).passes) {
      for (const auto &[stage, ms] : pass.stage_ms) views[view][stage] += ms;
    }
  }
  return views;
}

FrameReport measure(const Options &options, std::string command) {
  const ocl::DeviceInfo device_info = ocl::choose_device(options.device);
  CompressedVolume volume =
      tools::load_volume(options.volume, tools::to_overrides(options.volume_options), options.rate);
  const std::vector<Camera> cameras = orbit_cameras(volume.info, options.orbit);
  FrameReport report;
  report.command = std::move(command);
  report.volume = options.volume;
  report.isovalue = isovalue_of(options, volume);
  report.options = options.renderer;
  report.options.size = {options.size.at(0), options.size.at(1)};
  report.options.solver = solver_from_string(options.solver);
  report.options.grouping = grouping_from_string(options.grouping);
  report.rounds = options.rounds;
  {
    ocl::Device device(device_info);
    Renderer renderer(device, volume, report.options);
    report.run_info = run_info(device);
    report.options = renderer.options();
    report.setup_ms = renderer.setup_ms();
    report.views = measure_views(renderer, cameras, report.isovalue, options.rounds);
    report.peak_bytes = device.ledger().peak();
    report.memory = tools::memory_json(device.ledger());
  }
  {
    ocl::Device device(device_info, true);
    Renderer renderer(device, volume, report.options);
    report.stage_clock = clock_name(device.timer().source());
    report.stage_ms = measure_stages(device, renderer, cameras, report.isovalue);
  }
  volume.words.clear();
  report.grid = std::move(volume);
  return report;
}

void add_options(CLI::App &app, Options &options) {
  app.add_option("VOLUME", options.volume, "a .zfp file, or " + std::string(tools::kVolumeHelp))->required();
  tools::add_volume_options(app, options.volume_options);
  app.add_option("--isovalue,-i", options.isovalue, "isovalue [the middle of the volume's values]");
  app.add_option("--rate", options.rate,
                 "bits per voxel when an uncompressed volume is compressed on the fly")
      ->capture_default_str();
  app.add_option("--size", options.size, "picture size WxH [1280x720]")->delimiter('x')->expected(2);
  app.add_option("--orbit", options.orbit, "views around the volume")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "times that every view is drawn")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--device", options.device,
                 "device: index, cpu, gpu, or a part of its name [ISOWAVE_DEVICE, or the first GPU]");
  app.add_option("--max-speculation", options.renderer.max_speculation,
                 "most blocks a ray looks ahead, 1..64; 1 is none")
      ->capture_default_str();
  app.add_option("--cache-slots", options.renderer.cache_slots,
                 "decoded blocks kept on the device, at least 8 [2^18 or all]")
      ->check(CLI::Range(8u, 1u << 30));
  app.add_option("--solver", options.solver, "root finder: linear, marmitt, analytic or bernstein")
      ->capture_default_str();
  app.add_option("--grouping", options.grouping, "how rays are gathered by block: radix or counting")
      ->capture_default_str();
  app.add_option("--group-size", options.renderer.group_size, "work-items per work-group, 8..256")
      ->capture_default_str();
  app.add_option("--json", options.json, "also write everything to this file");
}

}  // namespace

}  // namespace isowave::bench

int main(int argc, char **argv) {
  CLI::App app("Times whole frames of a volume: cold, warm and the next view, and each stage.");
  isowave::bench::Options options;
  isowave::bench::add_options(app, options);
  try {
    app.parse(argc, argv);
    const std::string command = fmt::format("{}", fmt::join(argv, argv + argc, " "));
    const isowave::bench::FrameReport report = isowave::bench::measure(options, command);
    isowave::bench::print_report(report);
    if (!options.json.empty()) isowave::tools::write_json(isowave::bench::to_json(report), options.json);
    return 0;
  } catch (const CLI::Success &help) {
    return app.exit(help);
  } catch (const std::exception &error) {
    fmt::print(stderr, "frame_bench: {}\n", error.what());
    return 1;
  }
}
