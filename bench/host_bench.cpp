// host_bench: frames that are drawn without OpenCL (core/host), ray by ray and in packets of eight
// rays, in turns in one process; and with nothing decoded before. Ends with an error where a bit of
// a hit differs. With --voxel-pixels: frames of levels of detail. With --surfaces: frames of so
// many translucent surfaces, beside that of the first of them alone, opaque.
//
//   host_bench VOLUME [--isovalues 40,80,120] [--views 3] [--rounds 5] [--voxel-pixels 0,1,2,4]
//   host_bench VOLUME --isovalues 128,126,130 --surfaces 1,3

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
#include "core/host/host_levels.hpp"
#include "core/host/host_renderer.hpp"
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
  std::vector<double> voxel_pixels;
  std::vector<std::uint32_t> surfaces;
  float opacity = 0.3f;
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

/// Draws tiles of 16 x 16 rays, on as many threads as asked for.
template <class DrawTile>
void draw_tiles(const ScreenBox &screen, std::uint32_t threads, const DrawTile &draw_tile) {
  constexpr std::uint32_t kEdge = 16;
  if (screen.begin_x >= screen.end_x || screen.begin_y >= screen.end_y) return;
  const std::uint32_t columns = (screen.end_x - screen.begin_x + kEdge - 1) / kEdge,
                      rows = (screen.end_y - screen.begin_y + kEdge - 1) / kEdge;
  parallel_for(std::uint64_t{columns} * rows, threads, [&](std::uint64_t tile, std::uint32_t) {
    const auto x = static_cast<std::uint32_t>(screen.begin_x + tile % columns * kEdge),
               y = static_cast<std::uint32_t>(screen.begin_y + tile / columns * kEdge);
    draw_tile(RayTile{x, y, std::min(x + kEdge, screen.end_x), std::min(y + kEdge, screen.end_y)});
  });
}

using Trace = decltype(HostLoops::trace);

void draw(const FrameParams &frame, const HostField &field, Trace trace, bool is_smooth,
          std::uint32_t threads, std::vector<HitRecord> &hits) {
  draw_tiles(frame.screen, threads,
             [&](const RayTile &tile) { trace(frame, field, tile, is_smooth, hits.data()); });
}

std::uint64_t num_differing_of(const std::vector<HitRecord> &hits,
                               const std::vector<HitRecord> &expected) {
  std::uint64_t number = 0;
  for (std::size_t ray = 0; ray < hits.size(); ++ray)
    number += std::memcmp(&hits[ray], &expected[ray], sizeof(HitRecord)) != 0;
  return number;
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
          for (const HitRecord &hit : hits) num_hits += hit.block_id != ISO_INVALID_ID;
          num_differing += num_differing_of(hits, expected);
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

/// What frames of levels of detail take, for a distance of voxels.
struct LevelTimes {
  std::vector<double> rays, packets, cold;  ///< ms; cold: in packets, with nothing decoded
  std::uint64_t decoded = 0;                ///< blocks of cold frames
  std::size_t first_level = ~std::size_t{0}, last_level = 0;
};

/// Draws each view with each distance of voxels, in turns.
void measure_levels(const Options &options) {
  tools::CompressionOptions compression = options.compression;
  compression.levels = 0;
  const CompressedVolume volume = tools::load_volume(options.volume, {}, compression);
  const ImageSize size{options.size.at(0), options.size.at(1)};
  HostLevels levels(volume, HostBlocks::kNoLimit, options.threads);
  std::vector<LevelTimes> times(options.voxel_pixels.size());
  std::uint64_t num_rays = 0, num_differing = 0;
  for (const float isovalue : isovalues_of(options, volume)) {
    for (const Camera &camera : orbit_cameras(volume.info, options.views)) {
      for (std::uint32_t round = 0; round <= options.rounds; ++round) {  // the first makes levels
        for (std::size_t i = 0; i < times.size(); ++i) {
          LevelTimes &of = times[i];
          const std::vector<FrameParams> frames =
              make_level_frames(levels.infos(), camera, size, isovalue, options.voxel_pixels[i]);
          const std::vector<HostLevel> drawing = levels.open(frames);
          const auto draw_by = [&](auto trace, std::vector<HitRecord> &hits) {
            return milliseconds([&] {
              draw_tiles(drawing.front().frame.screen, options.threads,
                         [&](const RayTile &tile) { trace(drawing, tile, false, hits.data()); });
            });
          };
          std::vector<HitRecord> by_rays(size.num_rays(), no_hit()), hits = by_rays, cold = hits;
          levels.forget();
          const std::uint64_t before = levels.num_decoded();
          const double cold_ms = draw_by(host_loops().trace_levels, cold);
          const std::uint64_t decoded = levels.num_decoded() - before;
          const double packets_ms = draw_by(host_loops().trace_levels, hits),
                       rays_ms = draw_by(host_loops().trace_rays_of_levels, by_rays);
          if (round == 0) {
            num_rays += hits.size();
            num_differing += num_differing_of(hits, by_rays) + num_differing_of(cold, by_rays);
            of.decoded += decoded;
            const auto first = std::ranges::find_if(frames, draws) - frames.begin();
            of.first_level = std::min(of.first_level, static_cast<std::size_t>(first));
            of.last_level =
                std::max(of.last_level, static_cast<std::size_t>(first) + drawing.size() - 1);
            continue;
          }
          of.cold.push_back(cold_ms);
          of.packets.push_back(packets_ms);
          of.rays.push_back(rays_ms);
        }
      }
    }
  }
  fmt::print("{}: {} x {} x {}; {} threads; ms, medians\n", options.volume, volume.info.dims.x,
             volume.info.dims.y, volume.info.dims.z, thread_count(options.threads));
  fmt::print("  {:>12}{:>10}{:>10}{:>10}{:>10}{:>14}\n", "voxel pixels", "levels", "rays",
             "packets", "cold", "blocks decoded");
  for (std::size_t i = 0; i < times.size(); ++i) {
    const LevelTimes &of = times[i];
    fmt::print("  {:>12}{:>10}{:>10.1f}{:>10.1f}{:>10.1f}{:>14}\n", options.voxel_pixels[i],
               fmt::format("{}-{}", of.first_level, of.last_level), median(of.rays),
               median(of.packets), median(of.cold), of.decoded);
  }
  fmt::print("  {} rays, {} differ from those ray by ray\n", num_rays, num_differing);
  if (num_differing != 0) throw Error("{} hits differ", num_differing);
}

/// Draws each view in turns: the first isovalue alone, and the numbers of isovalues in
/// options.surfaces as layers.
void measure_surfaces(const Options &options) {
  const CompressedVolume volume = tools::load_volume(options.volume, {}, options.compression);
  const std::vector<float> isovalues = isovalues_of(options, volume);
  HostRenderer renderer(volume, {.num_threads = options.threads,
                                 .largest = {options.size.at(0), options.size.at(1)}});
  struct Way {
    std::string name;
    std::vector<SurfaceStyle> surfaces;
    std::vector<double> times;
    LayerStats layers;
  };
  std::vector<Way> ways = {{"1, plain", {}, {}, {}},
                           {"1, opaque", {{.isovalue = isovalues[0]}}, {}, {}}};
  for (const std::uint32_t number : options.surfaces) {
    ways.push_back({fmt::format("{}, opacity {}", number, options.opacity), {}, {}, {}});
    for (std::uint32_t i = 0; i < number; ++i)
      ways.back().surfaces.push_back({.isovalue = isovalues.at(i), .opacity = options.opacity});
  }
  std::uint64_t num_rays = 0;
  for (const Camera &camera : orbit_cameras(volume.info, options.views)) {
    for (std::uint32_t round = 0; round <= options.rounds; ++round) {  // the first decodes
      for (std::size_t i = 0; i < ways.size(); ++i) {
        Way &way = ways[(i + round) % ways.size()];
        FrameRequest request{.camera = camera, .isovalue = isovalues[0]};
        request.surfaces = way.surfaces;
        renderer.render(request);  // so that no time has that of selecting isovalues
        FrameStats stats;
        const double ms = milliseconds([&] {
          stats = renderer.render(request);
          renderer.fetch({.picture = true}, {});
        });
        if (round != 0) way.times.push_back(ms);
        if (round == 0) way.layers.add(stats.layers);
      }
    }
    num_rays += renderer.size().num_rays();
  }
  fmt::print("{}: {} x {} x {}, isovalues {}; {} threads; ms with pictures, medians\n",
             options.volume, volume.info.dims.x, volume.info.dims.y, volume.info.dims.z,
             fmt::join(isovalues, " "), thread_count(options.threads));
  fmt::print("  {:<20}{:>10}{:>10}{:>10}{:>14}{:>10}\n", "surfaces", "ms", "ratio", "layers",
             "hits per ray", "cut");
  for (const Way &way : ways) {
    fmt::print("  {:<20}{:>10.1f}{:>10.2f}{:>10}{:>14.2f}{:>10}\n", way.name, median(way.times),
               median(way.times) / median(ways[0].times), way.layers.layers,
               static_cast<double>(way.layers.hits) / static_cast<double>(num_rays),
               way.layers.rays_cut);
  }
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
  app.add_option("--num-threads", options.threads, "0: one per processor")->capture_default_str();
  app.add_option("--size", options.size, "picture size WxH [1280x720]")
      ->delimiter('x')
      ->expected(2);
  app.add_option("--rate", options.compression.rate, "bits per voxel [4]");
  app.add_option("--voxel-pixels", options.voxel_pixels,
                 "draw levels of detail instead, with each of these largest distances between "
                 "voxels of a coarser level [pixels]")
      ->delimiter(',');
  app.add_option("--surfaces", options.surfaces,
                 "numbers of isovalues to draw as translucent surfaces, in turns")
      ->check(CLI::Range(1u, static_cast<unsigned>(ISO_MAX_SURFACES)))
      ->delimiter(',');
  app.add_option("--opacity", options.opacity, "of translucent surfaces")->capture_default_str();
  app.callback([&] {
    for (const std::uint32_t number : options.surfaces) {
      if (number > 3 && number > options.isovalues.size())
        throw Error("{} surfaces need as many isovalues: give --isovalues", number);
    }
    if (!options.surfaces.empty()) {
      bench::measure_surfaces(options);
    } else if (options.voxel_pixels.empty()) {
      bench::measure(options);
    } else {
      bench::measure_levels(options);
    }
  });
  return tools::run_program(app, argc, argv);
}
