#pragma once
// The walk's decisions with the float filter against the same by two-float alone: for tests, and
// for the program whose mutants have a weaker filter (mutants.cmake).

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "kernels_cl/portable/grid_dda.h"

namespace isowave::core::test {

struct PredicateFuzz {
  std::uint64_t rays = 0, decisions = 0;
  std::uint64_t doubts = 0;  ///< exits that float32 left to two-float
  std::uint64_t wrong = 0;   ///< decisions that differ
};

/// Rays that are hard on a grid walk: ties, eyes on planes and voxels, along axes, from afar.
class HardRays {
 public:
  explicit HardRays(std::uint32_t seed) : random_(seed) {}

  int whole(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<std::uint32_t>(high - low + 1));
  }
  float real(float low, float high) {
    return low + (high - low) * static_cast<float>(random_() % (1u << 24)) * 0x1p-24f;
  }

  LastPlanes grid() { return {whole(1, 70), whole(1, 70), whole(1, 70)}; }

  Ray next(LastPlanes last) {
    const int ends[3] = {last.x, last.y, last.z};
    const int eye = whole(0, 5), way = whole(0, 4), still = whole(0, 5);
    float o[3], d[3];
    for (int axis = 0; axis < 3; ++axis) {
      const auto end = static_cast<float>(ends[axis]);
      const float target = real(0, end);
      d[axis] = way <= 1 ? real(-1, 1)
                : way == 2
                    ? static_cast<float>(2 * whole(0, 1) - 1) * 0.75f  // the diagonals of cells
                : way == 3 ? static_cast<float>(whole(-8, 8)) * 0.09375f
                           : std::ldexp(real(-1, 1), -whole(0, 39));
      o[axis] = eye == 0   ? real(0, end)
                : eye == 1 ? static_cast<float>(whole(0, ends[axis]))
                : eye == 2 ? static_cast<float>(whole(-2 * ends[axis], 3 * ends[axis]))
                : eye == 3 ? target - 3000 * d[axis]
                : eye == 4 ? std::rint(target - 3000 * d[axis])
                           : target - (way == 4 ? 40.0f : 1e6f) * d[axis];
      if (whole(0, 9) == 0) o[axis] = std::nextafter(std::rint(o[axis]), 1e9f);
    }
    if (still <= 2) {  // along two axes, or in a plane of cells
      d[still] = 0;
      o[still] = whole(0, 1) != 0 ? std::rint(o[still]) : real(0, static_cast<float>(ends[still]));
      if (whole(0, 2) == 0) {
        const int other = (still + 1) % 3;
        d[other] = 0;
        o[other] = std::rint(real(0, static_cast<float>(ends[other])));
      }
    }
    if (d[0] == 0 && d[1] == 0 && d[2] == 0) d[whole(0, 2)] = 0.75f;
    return make_whole_ray(make_ray_axis(o[0], d[0]), make_ray_axis(o[1], d[1]),
                          make_ray_axis(o[2], d[2]));
  }

 private:
  std::mt19937 random_;
};

inline bool same(const RayEvent &a, const RayEvent &b) {
  return a.axis == b.axis && a.t.hi == b.t.hi && a.t.lo == b.t.lo;
}

/// By its definition: as many regions further as there are planes that the ray is above.
inline int locate_by_planes(RayAxis a, int axis, RayEvent e, int size, int first, int last) {
  int c = first;
  if (a.d == 0.0f)
    return std::clamp(static_cast<int>(std::floor(a.o / static_cast<float>(size))), first, last);
  while (c < last && is_above(a, axis, size * (c + 1), e) != 0) ++c;
  return c;
}

inline void check_locate(const Ray &ray, RayEvent e, int size, const int (&first)[3],
                         const int (&last)[3], PredicateFuzz &result) {
  const RayAxis axes[3] = {ray.x, ray.y, ray.z};
  for (int axis = 0; axis < 3; ++axis) {
    ++result.decisions;
    result.wrong += locate(axes[axis], axis, e, size, first[axis], last[axis]) !=
                    locate_by_planes(axes[axis], axis, e, size, first[axis], last[axis]);
  }
}

/// Walks a ray through the grid in regions of one size, and looks for each in the one around it.
inline void check_walk(const Ray &ray, LastPlanes last, int size, PredicateFuzz &result) {
  RayEvent enter;
  if (domain_entry(&ray, last, &enter) == 0) return;
  const int end[3] = {(last.x - 1) / size, (last.y - 1) / size, (last.z - 1) / size};
  const int zero[3] = {0, 0, 0};
  check_locate(ray, enter, size, zero, end, result);
  GridWalk w = walk_from(&ray, locate(ray.x, 0, enter, size, 0, end[0]),
                         locate(ray.y, 1, enter, size, 0, end[1]),
                         locate(ray.z, 2, enter, size, 0, end[2]), size, last);
  while (w.x >= 0 && w.x <= end[0] && w.y >= 0 && w.y <= end[1] && w.z >= 0 && w.z <= end[2]) {
    if (size > 1) {
      const int part = size / 4, first[3] = {4 * w.x, 4 * w.y, 4 * w.z};
      const int final[3] = {std::min(first[0] + 3, (last.x - 1) / part),
                            std::min(first[1] + 3, (last.y - 1) / part),
                            std::min(first[2] + 3, (last.z - 1) / part)};
      check_locate(ray, enter, part, first, final, result);
    }
    const RayEvent exit = walk_exit(&w, &ray), exact = first_exit(&ray, w.far_x, w.far_y, w.far_z);
    float times[3] = {w.t_x, w.t_y, w.t_z};
    std::sort(times, times + 3);
    ++result.decisions;
    result.doubts += in_doubt(times[0], times[1]) != 0;
    result.wrong += !same(exit, exact);
    walk_step(&w, &ray, exact, size, last);
    enter = exact;
  }
}

inline PredicateFuzz check_walks(std::uint64_t num_rays, std::uint32_t seed) {
  PredicateFuzz result;
  HardRays random(seed);
  while (result.rays < num_rays) {
    const LastPlanes last = random.grid();
    for (int i = 0; i < 50; ++i, ++result.rays) {
      const Ray ray = random.next(last);
      for (const int size : {1, 4, 16}) check_walk(ray, last, size, result);
    }
  }
  return result;
}

/// Exits by planes of two axes that the ray crosses at almost the same moment, from before the eye,
/// too. float32 puts a pair in the wrong order only where both moments are off by most of what they
/// can be.
inline PredicateFuzz check_near_ties(std::uint64_t num_rays, std::uint32_t seed) {
  PredicateFuzz result;
  HardRays random(seed);
  for (; result.rays < num_rays; ++result.rays) {
    const auto far = [&] { return static_cast<float>(random.whole(0, 4095)); };
    const float x = far(), y = far(), z = far();
    const RayAxis a = make_ray_axis(random.real(-3000, 3000), random.real(0.5f, 1));
    const TwoFloat t = plane_t(a, x);
    const float d = random.whole(0, 1) != 0 ? random.real(0.5f, 1) : random.real(-1, -0.5f);
    const double o = y - (double{t.hi} + double{t.lo}) * d * (1 + random.real(-1, 1) * 0x1p-22);
    const Ray ray =
        make_whole_ray(a, make_ray_axis(static_cast<float>(o), d), make_ray_axis(0.5f, 0));
    GridWalk w{};
    w.far_x = x;
    w.far_y = y;
    w.far_z = z;
    w.t_x = float_t(ray.x, x);
    w.t_y = float_t(ray.y, y);
    w.t_z = float_t(ray.z, z);
    ++result.decisions;
    result.doubts += in_doubt(std::min(w.t_x, w.t_y), std::max(w.t_x, w.t_y)) != 0;
    result.wrong += !same(walk_exit(&w, &ray), first_exit(&ray, x, y, z));
  }
  return result;
}

}  // namespace isowave::core::test
