// kernels_cl/portable/cell_intersect.h on the host against long double: signs, faces, first
// changes, whole cells.

#include "kernels_cl/portable/cell_intersect.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "core/frame/solvers.hpp"
#include "tests/cubic_oracle.hpp"
#include "tests/stage_support.hpp"

namespace isowave::core {
namespace {

Real largest_of(const Cubic &c) {
  return std::max({std::abs(c.b0), std::abs(c.b1), std::abs(c.b2), std::abs(c.b3)});
}

TEST(CellIntersect, LerpEndsAreExact) {
  Random random(1);
  std::uniform_real_distribution<float> value(-1e6f, 1e6f);
  for (int i = 0; i < 100000; ++i) {
    const float a = value(random),
                b = std::ldexp(value(random), static_cast<int>(random() % 60) - 30);
    ASSERT_EQ(lerp(0.0f, a, b), a);
    ASSERT_EQ(lerp(1.0f, a, b), b);
    ASSERT_EQ(lerp(static_cast<float>(random()) * 0x1p-32f, a, a), a);
  }
}

/// Both ends below 0 give below 0, both at or above give at or above: 0 itself, and the smallest
/// differences of values that a volume can hold (2^-97 * 2^-23), included. The error is 2 u
/// max(|a|, |b|).
TEST(CellIntersect, LerpKeepsSigns) {
  Random random(2);
  for (int i = 0; i < 2000000; ++i) {
    const auto magnitude = [&] {
      if (random() % 16 == 0) return 0.0f;
      return std::ldexp(1.0f + static_cast<float>(random()) * 0x1p-32f,
                        -static_cast<int>(random() % 121));
    };
    const float u = random() % 4 == 0 ? std::ldexp(1.0f, -static_cast<int>(random() % 30))
                                      : static_cast<float>(random() >> 8) * 0x1p-24f;
    const float a = magnitude(), b = magnitude();
    ASSERT_GE(lerp(u, a, b), 0.0f) << u << " " << a << " " << b << ", seed 2";
    if (a > 0 && b > 0) {
      ASSERT_LT(lerp(u, -a, -b), 0.0f) << u << " " << -a << " " << -b << ", seed 2";
    }
    const float c = random() % 2 ? b : -b;
    const Real exact = static_cast<Real>(a) + u * (static_cast<Real>(c) - a);
    ASSERT_LE(std::abs(lerp(u, a, c) - exact), 2 * kUnit * std::max(a, b) + 0x1p-149L)
        << u << " " << a << " " << c << ", seed 2";
  }
}

/// A ray that goes from one cell to the next: the cubic of the first ends in the bits that that of
/// the second begins with, whatever the other corners and events are.
TEST(CellIntersect, SharedFacesHaveEqualBits) {
  Random random(3);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (int i = 0; i < 1000000; ++i) {
    std::array<float, 3> d;
    for (float &component : d) component = random() % 8 == 0 ? 0.0f : unit(random);
    const int axis = static_cast<int>(random() % 3);
    if (d[axis] == 0.0f) d[axis] = 0.5f;
    const int step = d[axis] > 0 ? 1 : -1;
    std::array<int, 3> from;
    for (int &coordinate : from) coordinate = 5 + static_cast<int>(random() % 2000);
    std::array<int, 3> to = from;
    to[axis] += step;
    /* The eye: anywhere from within a voxel of the face to far away, so that the ray meets it. */
    const float distance = std::ldexp(1.0f, static_cast<int>(random() % 12));
    std::array<float, 3> o;
    for (int k = 0; k < 3; ++k)
      o[k] = static_cast<float>(from[k]) + 0.5f + unit(random) * 0.7f - distance * d[k];
    const Ray ray = make_whole_ray(make_ray_axis(o[0], d[0]), make_ray_axis(o[1], d[1]),
                                   make_ray_axis(o[2], d[2]));
    const RayAxis axes[3] = {ray.x, ray.y, ray.z};
    const int plane = step > 0 ? to[axis] : from[axis];
    const RayEvent face = make_event(plane_t(axes[axis], static_cast<float>(plane)), axis);
    /* Corners: the face's four are shared. */
    float near[8], far[8];
    for (int corner = 0; corner < 8; ++corner) near[corner] = unit(random);
    for (int corner = 0; corner < 8; ++corner) {
      const int bit = 1 << axis;
      const bool on_face = ((corner & bit) != 0) == (step < 0);
      far[corner] = on_face ? near[corner ^ bit] : unit(random);
    }
    const CellPoint other = {std::abs(unit(random)), std::abs(unit(random)),
                             std::abs(unit(random))};
    const Cubic before =
        segment_cubic(near, other, event_position(&ray, face, from[0], from[1], from[2], 1));
    const Cubic after =
        segment_cubic(far, event_position(&ray, face, to[0], to[1], to[2], 0), other);
    ASSERT_EQ(std::bit_cast<std::uint32_t>(before.b3), std::bit_cast<std::uint32_t>(after.b0))
        << "face " << i << ", seed 3";
  }
}

/// The four coefficients are the cubic along the segment. Each is three levels of lerp, 2 u M each;
/// b1 and b2 add the rounding of two sums, of 1/3 and of the product with it: 4 u M.
TEST(CellIntersect, SegmentCubicIsTheFieldAlongTheSegment) {
  Random random(4);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (int i = 0; i < 100000; ++i) {
    float w[8];
    for (float &corner : w) corner = unit(random);
    const CellPoint a = {std::abs(unit(random)), std::abs(unit(random)), std::abs(unit(random))},
                    b = {std::abs(unit(random)), std::abs(unit(random)), std::abs(unit(random))};
    const Polynomial f = power_basis(segment_cubic(w, a, b));
    for (const Real s : {0.0L, 0.3L, 0.5L, 0.9L, 1.0L}) {
      const Real x = a.x + s * (static_cast<Real>(b.x) - a.x),
                 y = a.y + s * (static_cast<Real>(b.y) - a.y),
                 z = a.z + s * (static_cast<Real>(b.z) - a.z);
      Real exact = 0;
      for (int corner = 0; corner < 8; ++corner) {
        exact += w[corner] * (corner & 1 ? x : 1 - x) * (corner & 2 ? y : 1 - y) *
                 (corner & 4 ? z : 1 - z);
      }
      ASSERT_LE(std::abs(f.value(s) - exact), 10 * kUnit)
          << "segment " << i << ", s " << s << ", seed 4";
    }
  }
}

/// Tests first_change on one cubic. Bounds, u = 2^-24, M = largest coefficient: de Casteljau has
/// three levels of 2 u M, so values are right to 6 u M; the last step moves s by less than 2^-23 =
/// 2 u, and the extremum where [0,1] is split is off by so little that the value there is right to
/// about 10 u M.
class FirstChangeChecker {
 public:
  void check(const Cubic &c) {
    const Polynomial f = power_basis(c);
    const Real largest = largest_of(c), noise = kUnit * largest;
    const FirstChange expected = first_change_of(f);
    float s = -1;
    const bool found = first_change(kDefaultSolver, c, &s) != 0;
    ++num_cubics;
    if (found) {
      ASSERT_TRUE(s >= 0.0f && s <= 1.0f) << s;
      /* Backward: the field is 0 there, but for values' rounding and two last steps along the
       * steepest slope.
       */
      ASSERT_LE(std::abs(f.value(s)), 6 * noise + 4 * kUnit * slope_near(f, s)) << "s " << s;
    }
    if (expected.margin <= 16 * noise) {
      ++num_ambiguous;
      return;
    }
    ASSERT_EQ(found, expected.found) << "the change is at " << static_cast<double>(expected.s);
    if (!found) return;
    ++num_hits;
    /* Forward: where the slope changes little between both answers, error = residual / slope: at
       most 6 u M / |f'| + 4 u, and 4 u |f'| <= 4 u 6 M. */
    const Real slope = std::abs(f.slope(expected.s));
    if (slope < 0.05L * largest) return;
    const Real error = std::abs(s - expected.s) * slope / noise;
    ASSERT_LE(error, 6 + 4 * slope / largest + 1)
        << "s " << s << ", not " << static_cast<double>(expected.s);
    worst = std::max(worst, error);
    ++num_measured;
  }

  std::size_t num_cubics = 0, num_ambiguous = 0, num_hits = 0, num_measured = 0;
  Real worst = 0;  ///< error of s in units of u M / |f'|

 private:
  static Real slope_near(const Polynomial &f, Real s) {
    const Real step = 0x1p-22L;
    return std::max(
        {std::abs(f.slope(s)), std::abs(f.slope(s - step)), std::abs(f.slope(s + step))});
  }
};

std::string text_of(const Cubic &c) {
  return fmt::format("cubic {:a} {:a} {:a} {:a}", c.b0, c.b1, c.b2, c.b3);
}

TEST(CellIntersect, FirstChangeOfRandomCubics) {
  Random random(5);
  std::uniform_real_distribution<float> unit(-1, 1);
  FirstChangeChecker checker;
  for (int i = 0; i < 1000000; ++i) {
    Cubic c = {unit(random), unit(random), unit(random), unit(random)};
    const uint kind = random() % 4;
    if (kind == 1) c = {c.b0 * 1e-3f, c.b1, c.b2, c.b3 * 1e-3f};
    if (kind >= 2) {  // the ends of what volumes may hold
      const float scale = kind == 2 ? 1e-28f : 1e37f;
      c = {c.b0 * scale, c.b1 * scale, c.b2 * scale, c.b3 * scale};
    }
    SCOPED_TRACE(text_of(c) + ", seed 5");
    checker.check(c);
    if (HasFatalFailure()) return;
  }
  EXPECT_LT(checker.num_ambiguous, checker.num_cubics / 500);
  EXPECT_GT(checker.num_hits, checker.num_cubics / 2);
  RecordProperty("worst_error_units", std::to_string(static_cast<double>(checker.worst)));
}

/// A curve that just reaches 0, or just does not: (s - r)^2 times a line, lifted or lowered.
TEST(CellIntersect, FirstChangeNearDoubleRoots) {
  Random random(6);
  std::uniform_real_distribution<Real> inner(0.05L, 0.95L), outer(1.2L, 3.0L);
  FirstChangeChecker checker;
  for (int i = 0; i < 300000; ++i) {
    const Real r = inner(random), q = random() % 2 ? outer(random) : -outer(random) + 1;
    const Real sign = random() % 2 ? 1 : -1;
    Polynomial f{{-r * r * q, r * r + 2 * r * q, -2 * r - q, 1}};
    const Real offset =
        std::ldexp(1.0L, -static_cast<int>(random() % 21)) * (random() % 2 ? 1 : -1);
    f.c[0] += offset;
    const auto &p = f.c;
    const Cubic c = {static_cast<float>(sign * p[0]), static_cast<float>(sign * (p[0] + p[1] / 3)),
                     static_cast<float>(sign * (p[0] + 2 * p[1] / 3 + p[2] / 3)),
                     static_cast<float>(sign * (p[0] + p[1] + p[2] + p[3]))};
    SCOPED_TRACE(text_of(c) + ", seed 6");
    checker.check(c);
    if (HasFatalFailure()) return;
  }
  EXPECT_LT(checker.num_ambiguous, checker.num_cubics / 3);
  EXPECT_GT(checker.num_hits, checker.num_cubics / 10);
}

TEST(CellIntersect, FirstChangeIsHalfOpen) {
  struct Case {
    Cubic c;
    bool found;
    float s;  ///< expected to 2^-22
  };
  const Case cases[] = {
      {{0, 0, 0, 0}, false, 0},  // a plateau is inside
      {{1, 1, 1, 1}, false, 0},
      {{-1, -1, -1, -1}, false, 0},
      {{0, 1, 1, 1}, false, 0},    // starts at the isovalue and rises: inside all the way
      {{0, -1, -1, -1}, true, 0},  // starts inside and leaves at once
      {{-1, -1, -1, 0}, true, 1},  // reaches it at the very end
      {{1, 1, 1, 0}, false, 0},    // touches from inside
      {{0, -1, -1, 0}, true, 0},   // leaves at once, comes back at the end
      {{0, 1, 1, 0}, false, 0},
      {{0, 0, 0, -1}, true, 0},
      {{-1, 0, 0, 0}, true, 1},
      {{0, 0, 0, 1}, false, 0},
      {{-1, -0.5f, 0.5f, 1}, true, 0.5f},
      {{1, 0.5f, -0.5f, -1}, true, 0.5f},
      {{-1, 3, -3, 1}, true, 0.11270167f},  // three roots: 1/2 and 1/2 +- sqrt(3/20)
      {{1, -3, 3, -1}, true, 0.11270167f},
      {{-1, 3, 3, -1}, true, 0.5f * (1 - 0.81649658f)},  // a hump; the far side is not asked for
      {{-3, 3.5f, 4.8333335f, 0},
       true,
       0.17985765f},  // another root, at the end, is where Newton would start
      {{0, 1.7488135f, -0.07187828f, -5.106889f}, true, 0.49816295f},
  };
  for (const Case &k : cases) {
    SCOPED_TRACE(text_of(k.c));
    float s = -1;
    ASSERT_EQ(first_change(kDefaultSolver, k.c, &s) != 0, k.found);
    /* A triple root at an end is flat: to 1/1000. */
    const bool flat = (k.c.b0 == 0 && k.c.b1 == 0) || (k.c.b3 == 0 && k.c.b2 == 0);
    if (k.found) {
      EXPECT_NEAR(s, k.s, flat ? 5e-3f : 0x1p-22f);
    }
  }
}

/// Coefficients of small whole numbers: zeros at ends and tangents in every combination. inside
/// must change between the ends if it differs there.
TEST(CellIntersect, FirstChangeNeverMissesEndsThatDiffer) {
  for (int n = 0; n < 5 * 5 * 5 * 5; ++n) {
    const Cubic c = {float(n % 5 - 2), float(n / 5 % 5 - 2), float(n / 25 % 5 - 2),
                     float(n / 125 - 2)};
    SCOPED_TRACE(text_of(c));
    float s = -1;
    const bool found = first_change(kDefaultSolver, c, &s) != 0;
    if ((c.b0 >= 0) != (c.b3 >= 0)) {
      EXPECT_TRUE(found);
    }
    if (found) {
      EXPECT_TRUE(s >= 0.0f && s <= 1.0f) << s;
    }
    FirstChangeChecker checker;
    checker.check(c);
    if (HasFatalFailure()) return;
  }
}

/// f along the exact ray (o + t d) - cell, t = enter + s (exit - enter).
Polynomial exact_cubic(const Ray &ray, const float *w, const std::array<int, 3> &cell, Real enter,
                       Real exit) {
  const RayAxis axes[3] = {ray.x, ray.y, ray.z};
  std::array<Real, 3> at, along;
  for (int axis = 0; axis < 3; ++axis) {
    at[axis] = static_cast<Real>(axes[axis].o) + enter * axes[axis].d - cell[axis];
    along[axis] = (exit - enter) * axes[axis].d;
  }
  Polynomial f;
  for (int corner = 0; corner < 8; ++corner) {
    Polynomial product{{w[corner], 0, 0, 0}};
    for (int axis = 0; axis < 3; ++axis) {
      const bool upper = corner >> axis & 1;
      const Real constant = upper ? at[axis] : 1 - at[axis],
                 linear = upper ? along[axis] : -along[axis];
      for (int degree = 3; degree >= 0; --degree) {
        product.c[degree] =
            product.c[degree] * constant + (degree > 0 ? product.c[degree - 1] * linear : 0);
      }
    }
    for (int degree = 0; degree < 4; ++degree) f.c[degree] += product.c[degree];
  }
  return f;
}

/// Whole cells, up to 3000 voxels from the eye: the hit's residual in the exact field on the exact
/// ray. In u M: positions of both ends 6 (u each on three axes, slope 2 M), coefficients 10, values
/// 6, last steps 4 |df/ds| / M <= 24: together 46; and 64 leaves the oracle's margin for hit or
/// miss.
TEST(CellIntersect, CellsFarFromTheEye) {
  Random random(7);
  std::uniform_real_distribution<float> unit(-1, 1);
  std::size_t num_cells = 0, num_ambiguous = 0, num_hits = 0;
  for (int i = 0; i < 500000; ++i) {
    float d[3], o[3], w[8];
    std::array<int, 3> cell;
    for (float &corner : w) corner = unit(random);
    for (float &component : d) component = random() % 16 == 0 ? 0.0f : unit(random);
    const float length = std::hypot(d[0], d[1], d[2]);
    if (length < 0.1f) continue;
    const float distance = std::ldexp(2.9f, static_cast<int>(random() % 11));
    for (int axis = 0; axis < 3; ++axis) {
      d[axis] /= length;
      cell[axis] = static_cast<int>(random() % 2000);
      o[axis] = static_cast<float>(cell[axis]) + 0.5f + 0.5f * unit(random) - distance * d[axis];
    }
    const Ray ray = make_whole_ray(make_ray_axis(o[0], d[0]), make_ray_axis(o[1], d[1]),
                                   make_ray_axis(o[2], d[2]));
    const LastPlanes last = {4000, 4000, 4000};
    const GridWalk region = walk_from(&ray, cell[0], cell[1], cell[2], 1, last);
    const RayEvent enter = region_entry(&ray, cell[0], cell[1], cell[2], 1, last),
                   exit = walk_exit(&region, &ray);
    if (!event_before(enter, exit)) continue;  // the ray passes by
    bool beside = false;
    const RayAxis axes[3] = {ray.x, ray.y, ray.z};
    for (int axis = 0; axis < 3; ++axis)
      beside |= d[axis] == 0 && (o[axis] < float(cell[axis]) || o[axis] > float(cell[axis] + 1));
    if (beside || axes[exit.axis].d == 0) continue;
    ++num_cells;

    const Real t_enter = static_cast<Real>(enter.t.hi) + enter.t.lo,
               t_exit = static_cast<Real>(exit.t.hi) + exit.t.lo;
    const Polynomial f = exact_cubic(ray, w, cell, t_enter, t_exit);
    const FirstChange expected = first_change_of(f);
    CellChange change;
    const bool found = change_in_cell(kDefaultSolver, &ray, w, cell[0], cell[1], cell[2], enter,
                                      exit, &change) != 0;
    const float s = found ? refine(kDefaultSolver, change.cubic, change.bracket) : -1;
    SCOPED_TRACE(fmt::format("ray {}, {} voxels away, seed 7", i, distance));
    if (found) {
      ASSERT_LE(std::abs(f.value(s)), 46 * kUnit);
      FrameParams frame = grid_frame({4001, 4001, 4001});
      frame.view.t_scale = 2;
      const HitRecord hit = make_hit(&frame, &ray, w, cell[0], cell[1], cell[2], enter, exit, s);
      const Real t = t_enter + s * (t_exit - t_enter);
      ASSERT_LE(std::abs(hit.t / 2 - t), 2 * kUnit * t);  // t itself is a float32
      ASSERT_EQ(hit.block_id,
                uint(cell[0] / 4) + 1001 * (uint(cell[1] / 4) + 1001 * uint(cell[2] / 4)));
      ASSERT_EQ(hit.cell, uint(cell[0] % 4 + 4 * (cell[1] % 4) + 16 * (cell[2] % 4)));
      const float local[3] = {hit.x, hit.y, hit.z},
                  gradient[3] = {hit.grad_x, hit.grad_y, hit.grad_z};
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_LE(std::abs(local[axis] - (axes[axis].o + t * axes[axis].d - cell[axis])), 4 * kUnit)
            << axis;
        Real slope = 0;
        for (int corner = 0; corner < 8; ++corner) {
          Real weight = corner >> axis & 1 ? 1 : -1;
          for (int other = 0; other < 3; ++other) {
            if (other != axis)
              weight *= corner >> other & 1 ? local[other] : 1 - Real(local[other]);
          }
          slope += weight * w[corner];
        }
        ASSERT_LE(std::abs(gradient[axis] - slope), 10 * kUnit)
            << axis;  // differences 2 u, two lerps 4 u each
      }
    }
    if (expected.margin <= 64 * kUnit) {
      ++num_ambiguous;
      continue;
    }
    ASSERT_EQ(found, expected.found);
    num_hits += found;
  }
  EXPECT_GT(num_cells, 100000u);
  EXPECT_GT(num_hits, num_cells / 10);
  EXPECT_LT(num_ambiguous, num_cells / 1000);
}

TEST(CellIntersect, CornersDifferIsHalfOpen) {
  float w[8];
  std::ranges::fill(w, 0.0f);
  EXPECT_FALSE(corners_differ(w));
  for (float &corner : w) {
    corner = -1e-30f;
    EXPECT_TRUE(corners_differ(w));
    corner = 5;
    EXPECT_FALSE(corners_differ(w));
  }
  std::ranges::fill(w, -1.0f);
  EXPECT_FALSE(corners_differ(w));
  for (float &corner : w) {
    corner = 0.0f;
    EXPECT_TRUE(corners_differ(w));
    corner = -2;
  }
}

}  // namespace
}  // namespace isowave::core
