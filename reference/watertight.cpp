#include "reference/watertight.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

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

/// The field between the voxels, which is what must be closed: trilinear, in double.
double trilinear(const std::vector<float> &voxels, const Vec &p) {
  std::array<std::size_t, 3> c;
  Vec f;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    c[axis] = std::min<std::size_t>(static_cast<std::size_t>(p[axis]), kEdge - 2);
    f[axis] = p[axis] - static_cast<double>(c[axis]);
  }
  double sum = 0;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const std::size_t x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
    sum += (x ? f[0] : 1 - f[0]) * (y ? f[1] : 1 - f[1]) * (z ? f[2] : 1 - f[2]) *
           double(voxels[c[0] + x + kEdge * (c[1] + y + kEdge * (c[2] + z))]);
  }
  return sum;
}

/// A ray, and how far along it a hit must have come at the latest.
struct Shot {
  Ray ray;
  float latest;
};

Shot random_shot(const std::vector<float> &voxels, Random &random) {
  const bool lattice = random.below(3) == 0;
  Vec target;
  do {
    target = random.in_box({1, 1, 1}, {kEdge - 2.0, kEdge - 2.0, kEdge - 2.0});
    if (lattice) {
      for (double &x : target) x = std::round(2 * x) / 2;
    }
  } while (trilinear(voxels, target) < 1e-3);
  Vec direction = random.direction();
  if (lattice) {
    do {
      for (double &d : direction) d = static_cast<int>(random.below(5)) - 2;
    } while (direction == Vec{});
  }
  const double distance = random.below(2) ? 0 : 64;  // from inside, or from outside
  const auto axis = [&](std::size_t i) {
    return make_ray_axis(static_cast<float>(target[i] - distance * direction[i]),
                         static_cast<float>(direction[i]));
  };
  // The ray that was rounded to float32 passes the inside point within 1e-5 voxels, far less than its depth inside.
  return {{axis(0), axis(1), axis(2)}, distance == 0 ? INFINITY : static_cast<float>(distance)};
}

WatertightResult run_surface(const Surface &surface, std::uint64_t num_rays, std::uint32_t seed,
                             Solver solver) {
  std::vector<float> voxels;
  for (std::uint32_t z = 0; z < kEdge; ++z) {
    for (std::uint32_t y = 0; y < kEdge; ++y) {
      for (std::uint32_t x = 0; x < kEdge; ++x) {
        voxels.push_back(static_cast<float>(surface.field({double(x), double(y), double(z)})));
      }
    }
  }
  FrameParams frame{};
  frame.dims_x = frame.dims_y = frame.dims_z = kEdge;
  frame.blocks_x = frame.blocks_y = frame.blocks_z = (kEdge + 3) / 4;
  frame.t_scale = 1;
  constexpr std::uint64_t kBatch = 1 << 14;  // one random stream each, so that threads do not change the rays
  const std::uint64_t num_batches = (num_rays + kBatch - 1) / kBatch;
  std::atomic<std::uint64_t> next_batch{0}, leaks{0};
  const auto work = [&] {
    for (std::uint64_t batch = next_batch++; batch < num_batches; batch = next_batch++) {
      Random random(seed * 0x9E3779B97F4A7C15u + batch);
      for (std::uint64_t i = batch * kBatch; i < std::min(num_rays, (batch + 1) * kBatch); ++i) {
        const Shot shot = random_shot(voxels, random);
        const HitRecord hit = trace_scalar(frame, voxels, solver, shot.ray);
        if (!std::isfinite(hit.t) || hit.t > shot.latest) ++leaks;
      }
    }
  };
  std::vector<std::jthread> pool;
  for (unsigned i = 1; i < std::max(1u, std::thread::hardware_concurrency()); ++i) pool.emplace_back(work);
  work();
  pool.clear();
  return {surface.name, num_rays, leaks};
}

}  // namespace

std::vector<WatertightResult> run_watertight(std::uint64_t num_rays, std::uint32_t seed, Solver solver) {
  std::vector<WatertightResult> results;
  for (const Surface &surface :
       {Surface{"sphere", sphere}, Surface{"torus", torus}, Surface{"gyroid shell", gyroid_shell}}) {
    results.push_back(run_surface(surface, num_rays, seed, solver));
  }
  return results;
}

}  // namespace isowave
