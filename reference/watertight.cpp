#include "reference/watertight.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "core/frame.hpp"
#include "core/pyramid.hpp"
#include "reference/random.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave {

namespace {

using Vec = std::array<double, 3>;

constexpr std::uint32_t kEdge = 42;  ///< voxels; not a multiple of 4
constexpr double kCentre = 20.3;

/// Closed surfaces at 0, positive inside, well within the grid.
double sphere(const Vec &p) {
  return 17 - std::hypot(p[0] - kCentre, p[1] - kCentre, p[2] - kCentre);
}

double torus(const Vec &p) {
  const double ring = std::hypot(p[0] - kCentre, p[1] - kCentre) - 12;
  return 5 - std::hypot(ring, p[2] - kCentre);
}

double gyroid_shell(const Vec &p) {
  const double k = 0.35;
  const double g = std::sin(k * p[0]) * std::cos(k * p[1]) + std::sin(k * p[1]) * std::cos(k * p[2]) +
                   std::sin(k * p[2]) * std::cos(k * p[0]);
  return std::min(2 * (0.7 - std::abs(g)), sphere(p));
}

struct Surface {
  const char *name;
  double (*field)(const Vec &);
};

/// A surface's grid, and coarser levels of it.
struct Pyramid {
  std::vector<FrameParams> frames;
  std::vector<std::vector<float>> voxels;
};

Pyramid make_pyramid(const Surface &surface, std::size_t num_levels) {
  Pyramid pyramid;
  VolumeInfo info;
  info.dims = glm::uvec3(kEdge);
  for (std::size_t level = 0; level < num_levels; ++level) {
    pyramid.frames.push_back(make_grid_params(info));
    pyramid.frames.back().t_scale = 1;
    if (level > 0) {
      pyramid.voxels.push_back(downsample(2u * info.dims - 2u, pyramid.voxels.back()));
    } else {
      std::vector<float> &voxels = pyramid.voxels.emplace_back();
      for (std::uint32_t z = 0; z < kEdge; ++z) {
        for (std::uint32_t y = 0; y < kEdge; ++y) {
          for (std::uint32_t x = 0; x < kEdge; ++x)
            voxels.push_back(static_cast<float>(surface.field({double(x), double(y), double(z)})));
        }
      }
    }
    info = coarser_level(info);
  }
  return pyramid;
}

/// The field between the voxels of a level, which is what must be closed: trilinear, in double. p: index space of the finest.
double trilinear(const Pyramid &pyramid, std::size_t level, const Vec &p) {
  const FrameParams &frame = pyramid.frames[level];
  const std::array<std::size_t, 3> dims{frame.dims_x, frame.dims_y, frame.dims_z};
  std::array<std::size_t, 3> c;
  Vec f;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double x = std::ldexp(p[axis], -static_cast<int>(level));
    c[axis] = std::min(static_cast<std::size_t>(x), dims[axis] - 2);
    f[axis] = x - static_cast<double>(c[axis]);
  }
  double sum = 0;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const std::size_t x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
    sum += (x ? f[0] : 1 - f[0]) * (y ? f[1] : 1 - f[1]) * (z ? f[2] : 1 - f[2]) *
           double(pyramid.voxels[level][c[0] + x + dims[0] * (c[1] + y + dims[1] * (c[2] + z))]);
  }
  return sum;
}

bool is_inside(const Pyramid &pyramid, const Vec &p) {
  for (std::size_t level = 0; level < pyramid.frames.size(); ++level) {
    if (trilinear(pyramid, level, p) < 1e-3) return false;
  }
  return true;
}

/// A ray, and how far along it a hit must have come at the latest.
struct Shot {
  std::vector<Ray> rays;            ///< in each level's index space
  std::vector<FrameParams> frames;  ///< with the ray's bands
  float latest;
};

Shot random_shot(const Pyramid &pyramid, Random &random) {
  const bool lattice = random.below(3) == 0;
  Vec target;
  do {
    target = random.in_box({1, 1, 1}, {kEdge - 2.0, kEdge - 2.0, kEdge - 2.0});
    if (lattice) {
      for (double &x : target) x = std::round(2 * x) / 2;
    }
  } while (!is_inside(pyramid, target));
  Vec direction = random.direction();
  if (lattice) {
    do {
      for (double &d : direction) d = static_cast<int>(random.below(5)) - 2;
    } while (direction == Vec{});
  }
  const double distance = random.below(2) ? 0 : 64;  // from inside, or from outside
  // The ray that was rounded to float32 passes the inside point within 1e-5 voxels, far less than its depth inside.
  Shot shot{{}, pyramid.frames, distance == 0 ? INFINITY : static_cast<float>(distance)};
  float begin = 0;
  for (std::size_t level = 0; level < pyramid.frames.size(); ++level) {
    const auto axis = [&](std::size_t i) {
      const float o = static_cast<float>(target[i] - distance * direction[i]);
      return make_ray_axis(std::ldexp(o, -static_cast<int>(level)),
                           std::ldexp(static_cast<float>(direction[i]), -static_cast<int>(level)));
    };
    shot.rays.push_back({axis(0), axis(1), axis(2)});
    shot.frames[level].begin_t = begin;
    if (level + 1 == pyramid.frames.size()) continue;
    begin += static_cast<float>(random.in_box({0, 0, 0}, {distance == 0 ? 20.0 : 60.0, 1, 1})[0]);
    shot.frames[level].end_t = begin;
  }
  return shot;
}

WatertightResult run_surface(const Surface &surface, std::uint64_t num_rays, std::uint32_t seed,
                             Solver solver, RayBands bands) {
  const Pyramid pyramid = make_pyramid(surface, bands == RayBands::kLevels ? 3 : 1);
  constexpr std::uint64_t kBatch = 1 << 14;  // one random stream each, so that threads do not change the rays
  const std::uint64_t num_batches = (num_rays + kBatch - 1) / kBatch;
  std::atomic<std::uint64_t> next_batch{0}, leaks{0};
  const auto work = [&] {
    for (std::uint64_t batch = next_batch++; batch < num_batches; batch = next_batch++) {
      Random random(seed * 0x9E3779B97F4A7C15u + batch);
      for (std::uint64_t i = batch * kBatch; i < std::min(num_rays, (batch + 1) * kBatch); ++i) {
        const Shot shot = random_shot(pyramid, random);
        const HitRecord hit = bands == RayBands::kOne
                                  ? trace_scalar(pyramid.frames[0], pyramid.voxels[0], solver, shot.rays[0])
                                  : trace_scalar_levels(shot.frames, pyramid.voxels, solver, shot.rays);
        if (!std::isfinite(hit.t) || hit.t > shot.latest) ++leaks;
      }
    }
  };
  std::vector<std::jthread> pool;
  for (unsigned i = 1; i < std::max(1u, std::thread::hardware_concurrency()); ++i) pool.emplace_back(work);
  work();
  pool.clear();
  return {surface.name + std::string(bands == RayBands::kLevels ? ", levels" : ""), num_rays, leaks};
}

}  // namespace

std::vector<WatertightResult> run_watertight(std::uint64_t num_rays, std::uint32_t seed, Solver solver,
                                             RayBands bands) {
  std::vector<WatertightResult> results;
  for (const Surface &surface :
       {Surface{"sphere", sphere}, Surface{"torus", torus}, Surface{"gyroid shell", gyroid_shell}}) {
    results.push_back(run_surface(surface, num_rays, seed, solver, bands));
  }
  return results;
}

}  // namespace isowave
