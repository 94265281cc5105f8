// kernels_cl/portable/grid_dda.h: crossings and positions against long double, walks of one size
// against those of another.

#include "kernels_cl/portable/grid_dda.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "kernels_cl/portable/touched_blocks.h"
#include "tests/ray_cases.hpp"
#include "tests/stage_support.hpp"

namespace isowave::core {
namespace {

using Real = long double;
constexpr Real kUnit = 0x1p-24L;  ///< largest relative error of one float32 operation

Real value_of(TwoFloat t) {
  return static_cast<Real>(t.hi) + static_cast<Real>(t.lo);
}

/// Eyes and directions of every size that a frame can make.
class RandomAxes {
 public:
  explicit RandomAxes(uint seed) : random_(seed) {}

  RayAxis next() {
    const uint kind = random_() % 8;
    float o = uniform(-3000, 3000);
    if (kind == 0) o = std::round(o);
    if (kind == 1) o = std::ldexp(uniform(-1, 1), -static_cast<int>(random_() % 59));
    if (kind == 2) o = std::nextafter(std::round(o), 0.0f);
    float d = std::ldexp(uniform(0.5f, 1), -static_cast<int>(random_() % 39));
    if (random_() % 2) d = -d;
    return make_ray_axis(o, d);
  }
  int plane() { return static_cast<int>(random_() % 4096); }
  float uniform(float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random_);
  }

 private:
  Random random_;
};

/// Relative error, in units of 2^-48: 1/d 1 | e inv_d.hi rounded 1 | its sum with s inv_d.lo
/// rounded 2 | l rounded 3 | e inv_d.lo left out 1. In all 2^-45.
TEST(GridDda, PlaneCrossingsHave45Bits) {
  RandomAxes random(1);
  Real largest = 0;
  for (int i = 0; i < 1000000; ++i) {
    const RayAxis a = random.next();
    const int plane = random.plane();
    const Real exact = (static_cast<Real>(plane) - a.o) / a.d;
    const TwoFloat t = plane_t(a, static_cast<float>(plane));
    ASSERT_LE(std::abs(value_of(t) - exact), 0x1p-45L * std::abs(exact))
        << "o " << a.o << ", d " << a.d << ", plane " << plane << ", seed 1";
    ASSERT_EQ(t.hi + t.lo, t.hi) << "not normalised: o " << a.o << ", d " << a.d << ", plane "
                                 << plane;
    if (exact != 0) largest = std::max(largest, std::abs(value_of(t) - exact) / std::abs(exact));
  }
  RecordProperty("largest_error_2^-48", std::to_string(static_cast<double>(largest / 0x1p-48L)));
}

/// One axis crosses its planes in order, however far the eye.
TEST(GridDda, PlaneCrossingsAscend) {
  RandomAxes random(2);
  for (int i = 0; i < 200000; ++i) {
    const RayAxis a = random.next();
    const int plane = random.plane();
    const TwoFloat here = plane_t(a, static_cast<float>(plane)),
                   next = plane_t(a, static_cast<float>(plane + 1));
    ASSERT_TRUE(a.d > 0 ? t_less(here, next) : t_less(next, here))
        << "o " << a.o << ", d " << a.d << ", plane " << plane << ", seed 2";
  }
}

/// u = 2^-24, s = o - c and p = t d, which cancel. Rounding of the result: u |x|. Rounding of the
/// corrections: t.lo d 2 u^2 |p|; + se 2 u^2 |p| + u^2 |s|; + re 3 u^2 |p| + 2 u^2 |s|. Together
/// they are below 8 u^2 (|p| + |s|).
TEST(GridDda, LocalPositionsKeepTheirBitsFarFromTheEye) {
  RandomAxes random(3);
  int within = 0;
  for (int i = 0; i < 1000000; ++i) {
    RayAxis a = random.next();
    const int cell = random.plane();
    /* A moment inside the cell, made by another axis. */
    const Real moment = (static_cast<Real>(cell) + random.uniform(-0.1f, 1.1f) - a.o) / a.d;
    TwoFloat t;
    t.hi = static_cast<float>(moment);
    t.lo = static_cast<float>(moment - t.hi);
    if (!(std::abs(moment) < 1e6L)) continue;
    const Real s = static_cast<Real>(a.o) - cell, p = value_of(t) * a.d;
    const Real exact = std::clamp<Real>(s + p, 0, 1);
    const float x = local_position(a, t, cell);
    ASSERT_LE(std::abs(x - exact), kUnit * exact + 8 * kUnit * kUnit * (std::abs(s) + std::abs(p)))
        << "o " << a.o << ", d " << a.d << ", cell " << cell << ", seed 3";
    ASSERT_TRUE(x >= 0.0f && x <= 1.0f);
    within += exact > 0 && exact < 1;
  }
  EXPECT_GT(within, 100000);  // the test is about those
}

TEST(GridDda, TinyDirectionsCountAsZero) {
  EXPECT_EQ(make_ray_axis(1, 0x1p-41f).d, 0.0f);
  EXPECT_EQ(make_ray_axis(1, -0x1p-41f).d, 0.0f);
  EXPECT_EQ(make_ray_axis(1, 0x1p-40f).d, 0x1p-40f);
  EXPECT_EQ(make_ray_axis(1, -0.0f).d, 0.0f);
}

TEST(GridDda, EventsHaveOneOrder) {
  const auto event = [](float hi, float lo, int axis) { return make_event({hi, lo}, axis); };
  const std::array<RayEvent, 7> ordered = {
      event(-1, 0, 2),        event(0, 0, 0), event(0, 0, 2),       start_event(),
      event(1, -0x1p-30f, 1), event(1, 0, 0), event(1, 0x1p-40f, 0)};
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    for (std::size_t j = 0; j < ordered.size(); ++j) {
      EXPECT_EQ(event_before(ordered[i], ordered[j]) != 0, i < j) << i << " and " << j;
    }
  }
}

using Cell = std::array<int, 3>;

/// A region of a walk and the event by which the ray came to it.
struct Visit {
  Cell region;
  RayEvent enter;
};

bool same_event(RayEvent a, RayEvent b) {
  return a.t.hi == b.t.hi && a.t.lo == b.t.lo && a.axis == b.axis;
}

Cell locate_all(const Ray &ray, RayEvent e, int size, const Cell &first, const Cell &last) {
  return {locate(ray.x, 0, e, size, first[0], last[0]),
          locate(ray.y, 1, e, size, first[1], last[1]),
          locate(ray.z, 2, e, size, first[2], last[2])};
}

/// Every region of `size` that the ray passes, in order.
std::vector<Visit> walk(const Ray &ray, LastPlanes last, int size) {
  std::vector<Visit> visits;
  RayEvent enter;
  if (!domain_entry(&ray, last, &enter)) return visits;
  const Cell end = {(last.x - 1) / size, (last.y - 1) / size, (last.z - 1) / size};
  const Cell start = locate_all(ray, enter, size, {0, 0, 0}, end);
  GridWalk w = walk_from(&ray, start[0], start[1], start[2], size, last);
  while (w.x >= 0 && w.x <= end[0] && w.y >= 0 && w.y <= end[1] && w.z >= 0 && w.z <= end[2]) {
    visits.push_back({{w.x, w.y, w.z}, enter});
    enter = walk_exit(&w, &ray);
    walk_step(&w, &ray, enter, size, last);
  }
  return visits;
}

class GridDdaWalks : public testing::TestWithParam<glm::uvec3> {
 protected:
  template <class Check>
  void for_each_ray(const Check &check) const {
    for (const CameraCase &c : camera_cases(GetParam())) {
      const FrameParams frame = case_frame(GetParam(), c);
      for (uint pixel = 0; pixel < frame.view.width * frame.view.height; ++pixel) {
        SCOPED_TRACE(fmt::format("camera '{}', pixel {}", c.name, pixel));
        check(make_ray(&frame, pixel), last_planes(&frame));
        if (HasFatalFailure()) return;
      }
    }
  }
};

/// Each step goes to a face neighbour, moments never go back, and each region is entered by the
/// event that region_entry and locate name without having walked.
TEST_P(GridDdaWalks, WalkingEqualsLocating) {
  std::size_t num_visits = 0;
  for_each_ray([&](const Ray &ray, LastPlanes last) {
    for (const int size : {1, 4, 16}) {
      const std::vector<Visit> visits = walk(ray, last, size);
      const Cell end = {(last.x - 1) / size, (last.y - 1) / size, (last.z - 1) / size};
      num_visits += visits.size();
      for (std::size_t i = 0; i < visits.size(); ++i) {
        const Cell r = visits[i].region;
        ASSERT_TRUE(same_event(region_entry(&ray, r[0], r[1], r[2], size, last), visits[i].enter))
            << "size " << size << ", visit " << i;
        ASSERT_EQ(locate_all(ray, visits[i].enter, size, {0, 0, 0}, end), r)
            << "size " << size << ", visit " << i;
        if (i == 0) continue;
        const Cell before = visits[i - 1].region;
        const int distance =
            std::abs(r[0] - before[0]) + std::abs(r[1] - before[1]) + std::abs(r[2] - before[2]);
        ASSERT_EQ(distance, 1) << "size " << size << ", visit " << i;
        ASSERT_FALSE(event_before(visits[i].enter, visits[i - 1].enter))
            << "size " << size << ", visit " << i;
      }
    }
  });
  EXPECT_GT(num_visits, 0u);
}

/// A walk through blocks or macrocells is the cell walk seen from afar: the same regions, entered
/// by the same events.
TEST_P(GridDdaWalks, CoarseWalksEqualTheCellWalk) {
  for_each_ray([&](const Ray &ray, LastPlanes last) {
    const std::vector<Visit> cells = walk(ray, last, 1);
    for (const int size : {4, 16}) {
      std::vector<Visit> expected;
      for (const Visit &cell : cells) {
        const Cell region = {cell.region[0] / size, cell.region[1] / size, cell.region[2] / size};
        if (expected.empty() || expected.back().region != region)
          expected.push_back({region, cell.enter});
      }
      const std::vector<Visit> got = walk(ray, last, size);
      ASSERT_EQ(got.size(), expected.size()) << "size " << size;
      for (std::size_t i = 0; i < got.size(); ++i) {
        ASSERT_EQ(got[i].region, expected[i].region) << "size " << size << ", visit " << i;
        ASSERT_TRUE(same_event(got[i].enter, expected[i].enter))
            << "size " << size << ", visit " << i;
      }
    }
  });
}

/// What spans of layers say, against every cell.
TEST_P(GridDdaWalks, TouchedBlocksAreThoseOfTheCells) {
  std::array<std::size_t, 8> num_touched{};
  for_each_ray([&](const Ray &ray, LastPlanes last) {
    std::map<Cell, uint> expected;
    for (const Visit &cell : walk(ray, last, 1)) {
      const auto [x, y, z] = cell.region;
      uint &touched = expected[{x / 4, y / 4, z / 4}];
      for (int corner = 0; corner < 8; ++corner) {
        const int voxel_x = x + (corner & 1), voxel_y = y + (corner >> 1 & 1),
                  voxel_z = z + (corner >> 2);
        touched |=
            1u << (voxel_x / 4 - x / 4 + 2 * (voxel_y / 4 - y / 4) + 4 * (voxel_z / 4 - z / 4));
      }
    }
    for (const auto &[block, touched] : expected) {
      ASSERT_EQ(touched_blocks(&ray, block[0], block[1], block[2], last), touched)
          << "block " << block[0] << ' ' << block[1] << ' ' << block[2];
      for (uint corner = 0; corner < 8; ++corner) num_touched[corner] += touched >> corner & 1u;
    }
  });
  if (GetParam() == glm::uvec3(18, 21, 17)) {
    for (const std::size_t count : num_touched)
      EXPECT_GT(count, 100u) << "else this scene tests nothing";
  }
}

/// Independent of all that is shared: the ray's stay in each cell by slabs, in double.
TEST_P(GridDdaWalks, EveryCellThatTheRayCrossesIsVisited) {
  constexpr double kLength = 1e-3;  // voxels
  std::size_t num_crossed = 0;
  for_each_ray([&](const Ray &ray, LastPlanes last) {
    const std::vector<Visit> visits = walk(ray, last, 1);
    const RayAxis axes[3] = {ray.x, ray.y, ray.z};
    const double speed = std::hypot(double(ray.x.d), double(ray.y.d), double(ray.z.d));
    const auto stay = [&](const Cell &cell) {  // length within the cell, negative if outside
      double enter = 0, exit = 1e30;
      for (int axis = 0; axis < 3; ++axis) {
        const double o = axes[axis].o, d = axes[axis].d, low = cell[axis], high = cell[axis] + 1;
        if (d == 0) {
          if (o < low || o > high) return -1e30;
          continue;
        }
        enter = std::max(enter, ((d > 0 ? low : high) - o) / d);
        exit = std::min(exit, ((d > 0 ? high : low) - o) / d);
      }
      return (exit - enter) * speed;
    };
    for (const Visit &visit : visits) ASSERT_GT(stay(visit.region), -1e-6);
    for (int z = 0; z < last.z; ++z) {
      for (int y = 0; y < last.y; ++y) {
        for (int x = 0; x < last.x; ++x) {
          /* A ray that runs exactly in a face belongs to the cell on one side of it. */
          const bool in_face = (ray.x.d == 0 && (ray.x.o == float(x) || ray.x.o == float(x + 1))) ||
                               (ray.y.d == 0 && (ray.y.o == float(y) || ray.y.o == float(y + 1))) ||
                               (ray.z.d == 0 && (ray.z.o == float(z) || ray.z.o == float(z + 1)));
          if (in_face || stay({x, y, z}) < kLength) continue;
          ++num_crossed;
          ASSERT_TRUE(std::ranges::any_of(visits,
                                          [&](const Visit &visit) {
                                            return visit.region == Cell{x, y, z};
                                          }))
              << "cell " << x << " " << y << " " << z;
        }
      }
    }
  });
  EXPECT_GT(num_crossed, 0u);
}

INSTANTIATE_TEST_SUITE_P(Dims, GridDdaWalks,
                         testing::Values(glm::uvec3(18, 21, 17), glm::uvec3(5, 6, 7),
                                         glm::uvec3(2, 9, 33), glm::uvec3(2, 2, 2)));

}  // namespace
}  // namespace isowave::core
