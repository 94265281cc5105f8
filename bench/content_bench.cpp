// content_bench: levels of detail by what tiles of 16^3 voxels contain, on the host, beside levels
// by distance. A tile takes the coarsest level whose surface is near enough to the finest one's
// where the isovalue passes. A ray goes from tile to tile; if two levels have it on different sides
// of the surface, it hits at their border.
//
//   content_bench VOLUME --isovalue V [--errors 0.5,1,2,4] [--size 1280x720] [--rounds 5]
//   content_bench VOLUME --isovalue V --factors 1,1.5,2,3  (a tile keeps FACTOR times the error)
//   content_bench VOLUME --isovalue V --groups 1,2,4  (so many tiles share a level, along each axis)

// Ids of blocks count on through all levels of detail. Before anything is included.
#define ISO_LEVELS 1
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/content_trace.hpp"
#include "core/accuracy/choose_detail.hpp"
#include "core/accuracy/ray_sample.hpp"
#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/host/host_levels.hpp"
#include "core/host/host_renderer.hpp"
#include "core/sources/load_volume.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/shade.h"

namespace isowave::core::bench {

namespace {

/// The voxels of a level.
struct LevelVoxels {
  glm::ivec3 dims;
  std::vector<float> values;

  float at(const glm::ivec3 &v) const {
    return values[static_cast<std::size_t>(v.x) +
                  static_cast<std::size_t>(dims.x) *
                      (static_cast<std::size_t>(v.y) +
                       static_cast<std::size_t>(dims.y) * static_cast<std::size_t>(v.z))];
  }
  double field(const glm::dvec3 &place) const {
    const glm::dvec3 p = glm::clamp(place, glm::dvec3(0), glm::dvec3(dims) - 1.0);
    const glm::ivec3 c = glm::min(glm::ivec3(p), dims - 2);
    const glm::dvec3 u = p - glm::dvec3(c);
    double sum = 0;
    for (int k = 0; k < 8; ++k) {
      const glm::ivec3 corner(k & 1, k >> 1 & 1, k >> 2);
      const glm::dvec3 share = glm::mix(1.0 - u, u, glm::dvec3(corner));
      sum += share.x * share.y * share.z * double{at(c + corner)};
    }
    return sum;
  }
  glm::dvec3 gradient(const glm::ivec3 &v) const {
    glm::dvec3 g(0);
    for (int axis = 0; axis < 3; ++axis) {
      glm::ivec3 low = v, high = v;
      low[axis] = std::max(v[axis] - 1, 0);
      high[axis] = std::min(v[axis] + 1, dims[axis] - 1);
      g[axis] = (double{at(high)} - double{at(low)}) / (high[axis] - low[axis]);
    }
    return g;
  }
};

/// Calls visit(voxel, axis) for each edge of a tile that the isovalue crosses.
template <class Visit>
void for_crossed_edges(const LevelVoxels &finest, const glm::ivec3 &tile, float isovalue,
                       Visit visit) {
  const glm::ivec3 begin = kTile * tile, end = glm::min(begin + kTile, finest.dims);
  for (int z = begin.z; z < end.z; ++z) {
    for (int y = begin.y; y < end.y; ++y) {
      for (int x = begin.x; x < end.x; ++x) {
        const glm::ivec3 v(x, y, z);
        for (int axis = 0; axis < 3; ++axis) {
          glm::ivec3 next = v;
          if (++next[axis] < finest.dims[axis] &&
              (finest.at(v) >= isovalue) != (finest.at(next) >= isovalue))
            visit(v, next);
        }
      }
    }
  }
}

/// How far a level's surface is from a place on the finest one, along its normal [voxels of the
/// finest level]; infinite: more than eight voxels.
double distance_to(const LevelVoxels &level, double voxel, const glm::dvec3 &place,
                   const glm::dvec3 &normal, double isovalue) {
  const auto value = [&](double s) { return level.field((place + s * normal) / voxel) - isovalue; };
  const double here = value(0);
  double ahead = here, behind = here, last = 0;
  for (double s = 0.25; s <= 8; s += s < 2 ? 0.25 : 1) {
    const double before = value(-s), after = value(s);
    double found = INFINITY;
    if ((after >= 0) != (here >= 0)) found = last + (s - last) * ahead / (ahead - after);
    if ((before >= 0) != (here >= 0))
      found = std::min(found, last + (s - last) * behind / (behind - before));
    if (std::isfinite(found)) return found;
    ahead = after;
    behind = before;
    last = s;
  }
  return INFINITY;
}

/// [tile][level] Of 99 % of the finest level's surface in a tile: how far the level's is from it
/// [voxels]. No levels: the tile has no surface.
using Displacements = std::vector<std::vector<double>>;

Displacements displacements(std::span<const LevelVoxels> levels, float isovalue,
                            std::uint32_t threads) {
  const LevelVoxels &finest = levels.front();
  const glm::ivec3 tiles = (finest.dims + kTile - 1) / kTile;
  Displacements all(static_cast<std::size_t>(tiles.x * tiles.y * tiles.z));
  parallel_for(all.size(), threads, [&](std::uint64_t number, std::uint32_t) {
    const int tile = static_cast<int>(number);
    const glm::ivec3 at(tile % tiles.x, tile / tiles.x % tiles.y, tile / tiles.x / tiles.y);
    std::vector<std::vector<double>> found(levels.size());
    for_crossed_edges(finest, at, isovalue, [&](const glm::ivec3 &a, const glm::ivec3 &b) {
      const double low = double{finest.at(a)}, high = double{finest.at(b)},
                   s = (double{isovalue} - low) / (high - low);
      const glm::dvec3 place = glm::mix(glm::dvec3(a), glm::dvec3(b), s),
                       gradient = glm::mix(finest.gradient(a), finest.gradient(b), s);
      const double length = glm::length(gradient);
      const glm::dvec3 normal = length > 0 ? gradient / length : glm::dvec3(b - a);
      for (std::size_t level = 1; level < levels.size(); ++level)
        found[level].push_back(distance_to(levels[level], std::ldexp(1.0, static_cast<int>(level)),
                                           place, normal, double{isovalue}));
    });
    if (found.back().empty()) return;
    all[number].assign(levels.size(), 0.0);
    for (std::size_t level = 1; level < levels.size(); ++level) {
      auto &of = found[level];
      const auto most = of.begin() + static_cast<std::ptrdiff_t>(0.99 * double(of.size() - 1));
      std::nth_element(of.begin(), most, of.end());
      all[number][level] = *most;
    }
  });
  return all;
}

/// The same for surfaces of all isovalues, by first order: the difference of values by the slope,
/// of 99 % of the voxels by their slopes. Of tiles that `where` knows.
Displacements displacements_by_slope(std::span<const LevelVoxels> levels,
                                     const Displacements &where, std::uint32_t threads) {
  const LevelVoxels &finest = levels.front();
  const glm::ivec3 tiles = (finest.dims + kTile - 1) / kTile;
  Displacements all(where.size());
  parallel_for(all.size(), threads, [&](std::uint64_t number, std::uint32_t) {
    if (where[number].empty()) return;
    const int tile = static_cast<int>(number);
    const glm::ivec3 begin = kTile * glm::ivec3(tile % tiles.x, tile / tiles.x % tiles.y,
                                                tile / tiles.x / tiles.y),
                     end = glm::min(begin + kTile, finest.dims);
    all[number].assign(levels.size(), 0.0);
    for (std::size_t level = 1; level < levels.size(); ++level) {
      std::vector<std::pair<double, double>> found;  // distance, slope
      double sum = 0;
      for (int z = begin.z; z < end.z; ++z) {
        for (int y = begin.y; y < end.y; ++y) {
          for (int x = begin.x; x < end.x; ++x) {
            const glm::ivec3 v(x, y, z);
            const double slope = glm::length(finest.gradient(v));
            if (slope == 0) continue;
            const double off = levels[level].field(glm::dvec3(v) / std::exp2(double(level))) -
                               double{finest.at(v)};
            found.emplace_back(std::abs(off) / slope, slope);
            sum += slope;
          }
        }
      }
      std::ranges::sort(found);
      double left = 0.99 * sum;
      for (const auto &[distance, slope] : found) {
        all[number][level] = distance;
        if ((left -= slope) <= 0) break;
      }
    }
  });
  return all;
}

/// [tile] the coarsest level that keeps the error from this camera.
std::vector<uchar> choose_levels(const Displacements &displaced, const VolumeInfo &info,
                                 const Camera &camera, ImageSize size, double pixels) {
  const glm::ivec3 tiles = (glm::ivec3(info.dims) + kTile - 1) / kTile;
  const glm::dmat3 to_world = info.index_to_world();
  const double voxel =
      std::max({glm::length(to_world[0]), glm::length(to_world[1]), glm::length(to_world[2])});
  const glm::dvec3 eye = glm::inverse(to_world) * (camera.eye - info.origin);
  std::vector<uchar> levels(displaced.size(), kNoLevel);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (displaced[i].empty()) continue;
    const int tile = static_cast<int>(i);
    const glm::dvec3 begin(
        kTile * glm::ivec3(tile % tiles.x, tile / tiles.x % tiles.y, tile / tiles.x / tiles.y));
    const glm::dvec3 nearest = glm::clamp(eye, begin, begin + double(kTile));
    const double pixel =
        pixel_size_at(camera, size.height, glm::length(to_world * (nearest - eye)));
    levels[i] = 0;
    for (std::size_t level = 1; level < displaced[i].size(); ++level) {
      if (displaced[i][level] * voxel <= pixels * pixel) levels[i] = static_cast<uchar>(level);
    }
  }
  return levels;
}

/// Gives all tiles of a group, so many along each axis, the finest of their levels.
void join_tiles(const VolumeInfo &info, int group, std::vector<uchar> &levels) {
  const glm::ivec3 tiles = (glm::ivec3(info.dims) + kTile - 1) / kTile,
                   groups = (tiles + group - 1) / group;
  const auto group_of = [&](std::size_t number) {
    const int tile = static_cast<int>(number);
    const glm::ivec3 at =
        glm::ivec3(tile % tiles.x, tile / tiles.x % tiles.y, tile / tiles.x / tiles.y) / group;
    return static_cast<std::size_t>(at.x + groups.x * (at.y + groups.y * at.z));
  };
  std::vector<uchar> finest(static_cast<std::size_t>(groups.x * groups.y * groups.z), kNoLevel);
  for (std::size_t i = 0; i < levels.size(); ++i)
    finest[group_of(i)] = std::min(finest[group_of(i)], levels[i]);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (levels[i] != kNoLevel) levels[i] = finest[group_of(i)];
  }
}

/// A frame's hits, what they took, and how near they are to those of full detail.
struct Measured {
  std::vector<HitRecord> hits;
  double cold_ms = INFINITY, warm_ms = INFINITY;
  std::uint64_t blocks = 0;
};

template <class DrawTile>
void draw_tiles(const FrameParams &frame, std::uint32_t threads, DrawTile draw_tile) {
  constexpr std::uint32_t kEdge = 16;
  const std::uint32_t width = frame.view.width, height = frame.view.height,
                      columns = (width + kEdge - 1) / kEdge, rows = (height + kEdge - 1) / kEdge;
  parallel_for(std::uint64_t{columns} * rows, threads, [&](std::uint64_t tile, std::uint32_t) {
    const auto x = static_cast<std::uint32_t>(tile % columns * kEdge),
               y = static_cast<std::uint32_t>(tile / columns * kEdge);
    draw_tile(RayTile{x, y, std::min(x + kEdge, width), std::min(y + kEdge, height)});
  });
}

struct Options {
  std::string volume;
  float isovalue = 0;
  std::vector<std::uint32_t> size = {1280, 720};
  std::vector<double> errors = {0.5, 1, 2, 4}, factors = {1};
  std::vector<int> groups = {1};  ///< tiles that share a level, along each axis
  std::uint32_t rounds = 5, threads = 0;
};

class Bench {
 public:
  explicit Bench(const Options &options)
      : options_(options),
        volume_(compress_volume([&] { return open_any_volume(options.volume, {}); }, options.volume,
                                {.exact = true, .levels = 0})),
        size_{options.size.at(0), options.size.at(1)},
        renderer_(volume_, {.num_threads = options.threads, .largest = size_}),
        levels_(volume_, HostBlocks::kNoLimit, options.threads),
        camera_(renderer_.camera(std::vector<float>{options.isovalue}, size_)) {
    for (const CompressedVolume *level : levels_of(volume_, true)) {
      if (voxels_.size() < kMostLevels)
        voxels_.push_back({glm::ivec3(level->info.dims), decode_with_libzfp(*level)});
    }
  }

  void run() {
    const auto begin = std::chrono::steady_clock::now();
    const Displacements displaced = displacements(voxels_, options_.isovalue, options_.threads);
    const double table_ms = ms_since(begin);
    const Displacements by_slope = displacements_by_slope(voxels_, displaced, options_.threads);
    finest_ = by_distance(camera_, size_, 0, options_.rounds);
    fmt::print(
        "{}, {} x {}, isovalue {}: finest level {} blocks, cold {:.1f} ms, warm {:.1f} ms; "
        "displacements {:.0f} ms\n",
        options_.volume, size_.width, size_.height, options_.isovalue, finest_.blocks,
        finest_.cold_ms, finest_.warm_ms, table_ms);
    for (const double error : options_.errors) {
      for (const Evidence by : {Evidence::kProof, Evidence::kSample}) report_by(by, error);
      report_content("slope", by_slope, 1, error);
      for (const double factor : options_.factors)
        report_content("content", displaced, factor, error);
    }
  }

 private:
  static double ms_since(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
        .count();
  }

  template <class DrawTile>
  Measured measured(const FrameParams &frame, std::uint32_t rounds, DrawTile draw_tile) {
    Measured result;
    for (std::uint32_t round = 0; round < rounds; ++round) {
      levels_.forget();
      const std::uint64_t before = levels_.num_decoded();
      for (double *ms : {&result.cold_ms, &result.warm_ms}) {
        result.hits.assign(std::size_t{frame.view.width} * frame.view.height, no_hit());
        const auto begin = std::chrono::steady_clock::now();
        draw_tiles(frame, options_.threads,
                   [&](const RayTile &tile) { draw_tile(tile, result.hits.data()); });
        *ms = std::min(*ms, ms_since(begin));
      }
      result.blocks = levels_.num_decoded() - before;
    }
    return result;
  }

  Measured by_distance(const Camera &camera, ImageSize size, double voxel_pixels,
                       std::uint32_t rounds) {
    const std::vector<FrameParams> frames =
        make_level_frames(levels_.infos(), camera, size, options_.isovalue, voxel_pixels);
    const std::vector<HostLevel> drawing = levels_.open(frames);
    return measured(frames[0], rounds, [&](const RayTile &tile, HitRecord *hits) {
      if (drawing.size() == 1) {
        host_loops().trace(drawing[0].frame, drawing[0].field, tile, false, hits);
      } else {
        host_loops().trace_levels(drawing, tile, false, hits);
      }
    });
  }

  Measured by_content(const Camera &camera, ImageSize size, const std::vector<uchar> &tiles,
                      std::uint32_t rounds) {
    std::vector<FrameParams> frames =
        make_level_frames(levels_.infos(), camera, size, options_.isovalue, 0);
    frames.resize(voxels_.size());
    for (FrameParams &frame : frames) frame.band = {0, INFINITY};
    const std::vector<HostLevel> drawing = levels_.open(frames);
    const ContentScene scene{drawing, tiles.data()};
    Measured result = measured(frames[0], rounds, [&](const RayTile &tile, HitRecord *hits) {
      packets_of_content::trace_content(scene, tile, hits);
    });
    if (size.stride == 1 && std::exchange(checked_, true)) return result;
    std::vector<HitRecord> alone(result.hits.size(), no_hit());
    parallel_for(alone.size(), options_.threads, [&](std::uint64_t ray, std::uint32_t) {
      trace_ray(scene, static_cast<uint>(ray), &alone[ray]);
    });
    std::uint64_t differing = 0;
    for (std::size_t ray = 0; ray < alone.size(); ++ray)
      differing += std::memcmp(&alone[ray], &result.hits[ray], sizeof(HitRecord)) != 0;
    if (differing != 0) throw Error("{} hits differ from those ray by ray", differing);
    return result;
  }

  void report_by(Evidence by, double error) {
    const auto start = std::chrono::steady_clock::now();
    const FrameRequest request{.camera = camera_, .isovalue = options_.isovalue, .size = size_};
    const double voxel_pixels =
        choose_detail(renderer_, volume_, request, error, by).detail.voxel_pixels;
    const std::string name =
        fmt::format("{}, E {:.2f}, {:.0f} ms", by == Evidence::kProof ? "proof" : "sample",
                    voxel_pixels, ms_since(start));
    if (voxel_pixels == 0) {
      fmt::print("  P {:<4} {:<26} full detail\n", error, name);
      return;
    }
    report(name, error, [&](const Camera &camera, ImageSize size, std::uint32_t rounds) {
      return by_distance(camera, size, voxel_pixels, rounds);
    });
  }

  void report_content(const char *name, const Displacements &displaced, double factor,
                      double error) {
    for (const int group : options_.groups) {
      std::vector<uchar> tiles =
          choose_levels(displaced, volume_.info, camera_, size_, factor * error);
      join_tiles(volume_.info, group, tiles);
      checked_ = false;
      report(fmt::format("{} {}^3, factor {}", name, kTile * group, factor), error,
             [&](const Camera &camera, ImageSize size, std::uint32_t rounds) {
               return by_content(camera, size, tiles, rounds);
             });
    }
  }

  /// What is seen in frames of a sample of the rays, and beside them.
  template <class DrawFrame>
  std::vector<SeenFrame> seen(double error, DrawFrame draw) {
    const ImageSize size = sample_of(size_);
    std::vector<SeenFrame> frames;
    for (const Camera &camera : cameras_beside(camera_, size.height, error)) {
      const std::vector<HitRecord> hits = draw(camera, size, 1).hits;
      const View view = make_view(volume_.info, camera, size);
      const Shading shading = make_shading(volume_.info, {});
      SeenFrame frame{depth_of(hits), {}, {}};
      for (std::size_t ray = 0; ray < hits.size(); ++ray) {
        const AmbientDirection normal = world_normal(&shading.params, hits[ray]);
        const RayPlace place = place_of_ray(&view, static_cast<int>(ray % view.width),
                                            static_cast<int>(ray / view.width));
        const glm::dvec2 at(twice_u(&view, place.column), twice_v(&view, place.row));
        frame.normals.push_back({normal.x, normal.y, normal.z});
        frame.positions.push_back(point_of_ray(camera, 0.5 * at, size.height, double{hits[ray].t}));
      }
      frames.push_back(std::move(frame));
    }
    return frames;
  }

  static void keep_least(Measured &least, Measured frame) {
    frame.cold_ms = std::min(frame.cold_ms, least.cold_ms);
    frame.warm_ms = std::min(frame.warm_ms, least.warm_ms);
    least = std::move(frame);
  }

  template <class DrawFrame>
  void report(const std::string &name, double error, DrawFrame draw) {
    // In turns with the finest level, so that other programs slow down both.
    Measured frame, finest;
    for (std::uint32_t round = 0; round < options_.rounds; ++round) {
      keep_least(finest, by_distance(camera_, size_, 0, 1));
      keep_least(frame, draw(camera_, size_, 1));
    }
    const SampledShare share = compare_hits(
        camera_, sample_of(size_),
        seen(error, [&](const Camera &camera, ImageSize size,
                        std::uint32_t rounds) { return by_distance(camera, size, 0, rounds); }),
        seen(error, draw), error);
    std::uint64_t hits = 0, holes = 0, along = 0, at_borders = 0;
    for (std::size_t ray = 0; ray < frame.hits.size(); ++ray) {
      const float true_t = finest_.hits[ray].t, t = frame.hits[ray].t;
      if (std::isinf(true_t)) continue;
      ++hits;
      holes += std::isinf(t);
      along += double{std::abs(t - true_t)} <=
               error * pixel_size_at(camera_, size_.height, double{true_t});
      at_borders += std::isfinite(t) && (frame.hits[ray].cell & ISO_AT_BORDER) == ISO_AT_BORDER;
    }
    fmt::print(
        "  P {:<4} {:<26} blocks {:6} ({:.2f} x fewer), cold {:6.1f} ms ({:.2f}), warm "
        "{:6.1f} ms ({:.2f}); within P: {:.2f} % of {}, along rays {:.2f} %; {} of {} lost; "
        "{} at borders\n",
        error, name, frame.blocks, double(finest_.blocks) / double(frame.blocks), frame.cold_ms,
        frame.cold_ms / finest.cold_ms, frame.warm_ms, frame.warm_ms / finest.warm_ms,
        100 * share.share(), share.num_hits, 100 * double(along) / double(hits), holes, hits,
        at_borders);
    std::fflush(stdout);
  }

  Options options_;
  CompressedVolume volume_;
  ImageSize size_;
  HostRenderer renderer_;
  HostLevels levels_;
  Camera camera_;
  std::vector<LevelVoxels> voxels_;  ///< [level]
  Measured finest_;
  bool checked_ = false;  ///< the bits of this way to draw
};

}  // namespace

}  // namespace isowave::core::bench

int main(int argc, char **argv) {
  using namespace isowave::core;
  bench::Options options;
  CLI::App app("Levels of detail by content");
  app.add_option("volume", options.volume)->required();
  app.add_option("--isovalue", options.isovalue)->required();
  app.add_option("--size", options.size)->delimiter('x')->expected(2);
  app.add_option("--errors", options.errors)->delimiter(',');
  app.add_option("--factors", options.factors)->delimiter(',');
  app.add_option("--groups", options.groups)->delimiter(',');
  app.add_option("--rounds", options.rounds);
  app.add_option("--threads", options.threads);
  CLI11_PARSE(app, argc, argv);
  try {
    bench::Bench(options).run();
  } catch (const std::exception &error) {
    fmt::print(stderr, "content_bench: {}\n", error.what());
    return 1;
  }
}
