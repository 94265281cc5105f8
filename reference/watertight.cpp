#include "reference/watertight.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/base/parallel_for.hpp"
#include "reference/closed_surfaces.hpp"
#include "reference/random.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::core {

namespace {

using Vec = std::array<double, 3>;

/// A ray, and how far along it a hit must have come at the latest.
struct Shot {
  std::vector<Ray> rays;            ///< in each level's index space
  std::vector<FrameParams> frames;  ///< with the ray's bands
  float latest;
};

Shot random_shot(const GridLevels &levels, Random &random) {
  const bool lattice = random.below(3) == 0;
  Vec target;
  do {
    target = random.in_box({1, 1, 1}, {kSurfaceEdge - 2.0, kSurfaceEdge - 2.0, kSurfaceEdge - 2.0});
    if (lattice) {
      for (double &x : target) x = std::round(2 * x) / 2;
    }
  } while (!levels.is_inside(target));
  Vec direction = random.direction();
  if (lattice) {
    do {
      for (double &d : direction) d = static_cast<int>(random.below(5)) - 2;
    } while (direction == Vec{});
  }
  const double distance = random.below(2) ? 0 : 64;  // from inside, or from outside
  // The ray that was rounded to float32 passes the inside point within 1e-5 voxels, far less than
  // its depth inside.
  Shot shot{{}, levels.frames, distance == 0 ? INFINITY : static_cast<float>(distance)};
  float begin = 0;
  for (std::size_t level = 0; level < levels.frames.size(); ++level) {
    const auto axis = [&](std::size_t i) {
      const float o = static_cast<float>(target[i] - distance * direction[i]);
      return make_ray_axis(std::ldexp(o, -static_cast<int>(level)),
                           std::ldexp(static_cast<float>(direction[i]), -static_cast<int>(level)));
    };
    shot.rays.push_back(make_whole_ray(axis(0), axis(1), axis(2)));
    shot.frames[level].band.begin_t = begin;
    if (level + 1 == levels.frames.size()) continue;
    begin += static_cast<float>(random.in_box({0, 0, 0}, {distance == 0 ? 20.0 : 60.0, 1, 1})[0]);
    shot.frames[level].band.end_t = begin;
  }
  for (std::size_t level = 0; level < shot.rays.size(); ++level)
    shot.rays[level] = in_band(shot.frames[level], shot.rays[level]);
  return shot;
}

WatertightResult run_surface(const ClosedSurface &surface, std::uint64_t num_rays,
                             std::uint32_t seed, Solver solver, RayBands bands) {
  const GridLevels levels = surface_levels(surface, bands == RayBands::kLevels ? 3 : 1);
  constexpr std::uint64_t kBatch =
      1 << 14;  // one random stream each, so that threads do not change the rays
  const std::uint64_t num_batches = (num_rays + kBatch - 1) / kBatch;
  std::atomic<std::uint64_t> leaks{0};
  parallel_for(num_batches, 0, [&](std::uint64_t batch, std::uint32_t) {
    Random random(seed * 0x9E3779B97F4A7C15u + batch);
    for (std::uint64_t i = batch * kBatch; i < std::min(num_rays, (batch + 1) * kBatch); ++i) {
      const Shot shot = random_shot(levels, random);
      const HitRecord hit =
          bands == RayBands::kOne
              ? trace_scalar(levels.frames[0], levels.voxels[0], solver, shot.rays[0])
              : trace_scalar_levels(shot.frames, levels.voxels, solver, shot.rays);
      if (!std::isfinite(hit.t) || hit.t > shot.latest) ++leaks;
    }
  });
  return {surface.name + std::string(bands == RayBands::kLevels ? ", levels" : ""), num_rays,
          leaks};
}

}  // namespace

std::vector<WatertightResult> run_watertight(std::uint64_t num_rays, std::uint32_t seed,
                                             Solver solver, RayBands bands) {
  std::vector<WatertightResult> results;
  for (const ClosedSurface &surface : closed_surfaces()) {
    results.push_back(run_surface(surface, num_rays, seed, solver, bands));
  }
  return results;
}

}  // namespace isowave::core
