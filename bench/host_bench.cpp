// host_bench: frames that are drawn without OpenCL (core/host), ray by ray and in packets of eight
// rays, in turns in one process; and with nothing decoded before. Ends with an error where a bit of
// a hit differs.
//
//   host_bench VOLUME [--isovalues 40,80,120] [--views 3] [--rounds 5]

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "bench/run_info.hpp"
#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/host/host_blocks.hpp"
#include "core/view/camera.hpp"
#include "core/view/detail.hpp"
#include "core/view/frame.hpp"
#include "kernels_cl/portable/cell_intersect.h"
#include "tools/isowave/program.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::bench {

namespace {

struct Options {
  std::string volume;
  std::vector<float> isovalues;
  std::uint32_t views = 3, rounds = 5, threads = 0;
  std::vector<std::uint32_t> size = {1280, 720};
  tools::CompressionOptions compression{.rate = 4};
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.at(values.size() / 2);
}

template <class Work>
double milliseconds(const Work &work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

using Trace = decltype(HostLoops::trace);

/// Draws the frame in tiles of 16 x 16 rays, on as many threads as asked for.
void draw(const FrameParams &frame, const HostField &field, Trace trace, bool is_smooth,
          std::uint32_t threads, std::vector<HitRecord> &hits) {
  constexpr std::uint32_t kEdge = 16;
  const ScreenBox &screen = frame.screen;
  if (screen.begin_x >= screen.end_x || screen.begin_y >= screen.end_y) return;
  const std::uint32_t columns = (screen.end_x - screen.begin_x + kEdge - 1) / kEdge,
                      rows = (screen.end_y - screen.begin_y + kEdge - 1) / kEdge;
  parallel_for(std::uint64_t{columns} * rows, threads, [&](std::uint64_t tile, std::uint32_t) {
    const auto x = static_cast<std::uint32_t>(screen.begin_x + tile % columns * kEdge),
               y = static_cast<std::uint32_t>(screen.begin_y + tile / columns * kEdge);
    trace(frame, field,
          {x, y, std::min(x + kEdge, screen.end_x), std::min(y + kEdge, screen.end_y)}, is_smooth,
          hits.data());
  });
}

/// Isovalues at a quarter, the middle and three quarters of the volume's values.
std::vector<float> isovalues_of(const Options &options, const CompressedVolume &volume) {
  if (!options.isovalues.empty()) return options.isovalues;
  const float low = volume.value_range[0], high = volume.value_range[1];
  if (!std::isfinite(low) || !std::isfinite(high))
    throw Error("{} does not say its range of values: give --isovalues", options.volume);
  return {0.75f * low + 0.25f * high, 0.5f * low + 0.5f * high, 0.25f * low + 0.75f * high};
}

void measure(const Options &options) {
  const CompressedVolume volume = tools::load_volume(options.volume, {}, options.compression);
  const ImageSize size{options.size.at(0), options.size.at(1)};
  double ranges_ms = 0;
  std::unique_ptr<HostBlocks> blocks;
  ranges_ms = milliseconds([&] {
    blocks = std::make_unique<HostBlocks>(volume, HostBlocks::kNoLimit, options.threads);
  });
  fmt::print("{}: {} x {} x {}, value ranges in {:.1f} ms; {} threads; ms, medians\n",
             options.volume, volume.info.dims.x, volume.info.dims.y, volume.info.dims.z, ranges_ms,
             thread_count(options.threads));
  struct Way {
    std::string name;
    Trace trace;
    bool is_smooth;
    bool is_cold = false;  ///< with nothing decoded
  };
  std::vector<Way> ways;
  for (const HostLoops &loops : all_host_loops()) {
    const bool best = &loops == &all_host_loops().back();
    if (ways.empty() || ways.back().trace != loops.trace_rays)
      ways.push_back({best ? "rays" : "rays, any processor", loops.trace_rays, false});
    if (loops.trace != loops.trace_rays)
      ways.push_back({best ? "packets" : "packets, SSE4.1", loops.trace, false});
    if (!best) continue;
    ways.push_back({"as drawn, smooth normals", loops.trace, true});
    ways.push_back({"the same, nothing decoded", loops.trace, true, true});
  }
  std::map<std::string, std::vector<double>> times;
  std::uint64_t num_rays = 0, num_hits = 0, num_differing = 0;
  std::vector<double> select_ms;
  for (const float isovalue : isovalues_of(options, volume)) {
    select_ms.push_back(milliseconds([&] { blocks->select(isovalue); }));
    for (const Camera &camera : orbit_cameras(volume.info, options.views)) {
      FrameParams frame = make_frame_params(volume.info, camera, size, isovalue);
      frame.surface = blocks->surface();
      frame.screen = make_screen_box(frame);
      std::vector<HitRecord> expected;
      std::vector<HitRecord> first(size.num_rays(), no_hit());
      draw(frame, blocks->field(), host_loops().trace, true, options.threads, first);
      for (std::uint32_t round = 0; round < options.rounds; ++round) {
        for (std::size_t i = 0; i < ways.size(); ++i) {
          const Way &way = ways[round == 0 ? i : (i + round) % ways.size()];
          std::vector<HitRecord> hits(size.num_rays(), no_hit());
          if (way.is_cold) blocks->forget();
          times[way.name].push_back(milliseconds([&] {
            draw(frame, blocks->field(), way.trace, way.is_smooth, options.threads, hits);
          }));
          if (expected.empty()) expected = hits;
          if (round > 0 || way.is_smooth) continue;
          num_rays += hits.size();
          for (std::size_t ray = 0; ray < hits.size(); ++ray) {
            num_hits += hits[ray].block_id != ISO_INVALID_ID;
            num_differing += std::memcmp(&hits[ray], &expected[ray], sizeof(HitRecord)) != 0;
          }
        }
      }
    }
  }
  fmt::print("  {:<28}{:8.1f}\n", "new isovalue: its blocks", median(select_ms));
  for (const Way &way : ways) fmt::print("  {:<28}{:8.1f}\n", way.name, median(times[way.name]));
  fmt::print("  {} rays, {} hits, {} differ from those ray by ray\n", num_rays, num_hits,
             num_differing);
  if (num_differing != 0) throw Error("{} hits differ", num_differing);
}

}  // namespace

}  // namespace isowave::core::bench

int main(int argc, char **argv) {
  using namespace isowave::core;
  CLI::App app("Times frames drawn without OpenCL, ray by ray and in packets.", "host_bench");
  bench::Options options;
  app.add_option("volume", options.volume, "a .zfp file, or " + std::string(tools::kVolumeHelp))
      ->required();
  app.add_option("--isovalues", options.isovalues,
                 "instead of three within the volume's range of values")
      ->delimiter(',');
  app.add_option("--views", options.views, "of an orbit")->capture_default_str();
  app.add_option("--rounds", options.rounds, "times that each frame is drawn each way")
      ->check(CLI::Range(1u, 100000u))
      ->capture_default_str();
  app.add_option("--threads", options.threads, "0: one per processor")->capture_default_str();
  app.add_option("--size", options.size, "picture size WxH [1280x720]")
      ->delimiter('x')
      ->expected(2);
  app.add_option("--rate", options.compression.rate, "bits per voxel [4]");
  app.callback([&] { bench::measure(options); });
  return tools::run_program(app, argc, argv);
}
