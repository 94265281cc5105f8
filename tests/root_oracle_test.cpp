// The root oracle against closed forms, and where only exact arithmetic can decide.

#include "reference/root_oracle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

namespace isowave::core {
namespace {

std::vector<float> sampled(std::array<std::uint32_t, 3> dims,
                           const std::function<double(double, double, double)> &f) {
  std::vector<float> voxels;
  for (std::uint32_t z = 0; z < dims[2]; ++z) {
    for (std::uint32_t y = 0; y < dims[1]; ++y) {
      for (std::uint32_t x = 0; x < dims[0]; ++x) voxels.push_back(static_cast<float>(f(x, y, z)));
    }
  }
  return voxels;
}

TEST(RootOracle, FindsAPlaneExactly) {
  const auto voxels = sampled({9, 7, 5}, [](double x, double, double) { return x; });
  const RootOracle oracle(voxels, {9, 7, 5}, 3.25f);
  const OracleHit hit = oracle.first_hit({{-2, 3.5, 1.5}, {0.5, 0.125, 0}});
  ASSERT_TRUE(hit.hit);
  EXPECT_NEAR(hit.t, 10.5, 1e-13);
  EXPECT_EQ(hit.cell, (std::array<int, 3>{3, 4, 1}));
  EXPECT_FALSE(oracle.first_hit({{-2, 3.5, 1.5}, {-0.5, 0, 0}}).hit);  // looks away
  EXPECT_FALSE(oracle.first_hit({{-2, 9, 1.5}, {1, 0, 0}}).hit);       // passes beside
}

TEST(RootOracle, FindsBothSheetsOfASaddle) {
  // (x - 2)(y - 2) along x = 1 + t, y = 1 + 1.5 t: zero at t = 2/3 and t = 1.
  const auto voxels =
      sampled({5, 5, 5}, [](double x, double y, double) { return (x - 2) * (y - 2); });
  const RootOracle oracle(voxels, {5, 5, 5}, 0);
  const OracleHit first = oracle.first_hit({{1, 1, 2}, {1, 1.5, 0}});
  ASSERT_TRUE(first.hit);
  EXPECT_NEAR(first.t, 2.0 / 3.0, 1e-14);
  const OracleHit second = oracle.first_hit({{1.8, 2.2, 2}, {1, 1.5, 0}});
  ASSERT_TRUE(second.hit);
  EXPECT_NEAR(second.t, 0.2, 1e-14);
}

TEST(RootOracle, StartingInsideIsAState) {
  const auto voxels = sampled({17, 17, 17}, [](double x, double y, double z) {
    return 5 - std::hypot(x - 8, y - 8, z - 8);
  });
  const RootOracle oracle(voxels, {17, 17, 17}, 0);
  const OracleHit hit = oracle.first_hit({{8, 8, 8}, {1, 0, 0}});
  ASSERT_TRUE(hit.hit);
  EXPECT_NEAR(hit.t, 5, 1e-14);  // on the lattice line the field is linear between voxels
}

// x y + (1 - x)(1 - y), that is, 1/2 in the middle of the face and its minimum along the diagonal.
std::vector<float> touching() {
  return {1, 0, 0, 1, 1, 0, 0, 1};
}

TEST(RootOracle, DecidesTouchingByTheHalfOpenRule) {
  const OracleRay diagonal{{-1, -1, 0.5}, {1, 1, 0}};
  // The field along the diagonal is 1 -> 1/2 -> 1. At isovalue 1/2 it touches from inside, which is
  // still inside.
  EXPECT_FALSE(RootOracle(touching(), {2, 2, 2}, 0.5f).first_hit(diagonal).hit);
  const float above = std::nextafter(0.5f, 1.0f);
  EXPECT_TRUE(RootOracle(touching(), {2, 2, 2}, above).first_hit(diagonal).hit);
  // Along the other diagonal it is 0 -> 1/2 -> 0: touching from outside is inside for one point.
  const OracleRay other{{-1, 2, 0.5}, {1, -1, 0}};
  const OracleHit hit = RootOracle(touching(), {2, 2, 2}, 0.5f).first_hit(other);
  ASSERT_TRUE(hit.hit);
  EXPECT_NEAR(hit.t, 1.5, 1e-12);
  EXPECT_FALSE(RootOracle(touching(), {2, 2, 2}, above).first_hit(other).hit);
}

TEST(RootOracle, UsesExactArithmeticWhereIntervalsCannotDecide) {
  const auto voxels = touching();
  const RootOracle oracle(voxels, {2, 2, 2}, 0.5f);
  EXPECT_FALSE(oracle.first_hit({{-1, -1, 0.5}, {1, 1, 0}}).hit);
  EXPECT_EQ(oracle.num_exact_cells(), 1u);
}

TEST(RootOracle, TakesCrossingsAtVerticesInAnyOrder) {
  const auto voxels = sampled({9, 9, 9}, [](double x, double y, double z) { return x + y + z; });
  const RootOracle oracle(voxels, {9, 9, 9}, 12);
  const OracleHit hit = oracle.first_hit({{-3, -3, -3}, {1, 1, 1}});
  ASSERT_TRUE(hit.hit);
  EXPECT_NEAR(hit.t, 7, 1e-14);
}

TEST(RootOracle, SeesTwoUlpsOfDepth) {
  // Half the cells are one ulp above the isovalue, so hits depend on single bits of voxels.
  const float isovalue = 1.0f, above = std::nextafter(1.0f, 2.0f);
  const auto voxels =
      sampled({3, 3, 3}, [&](double x, double, double) { return x == 1 ? above : 0.5; });
  EXPECT_TRUE(RootOracle(voxels, {3, 3, 3}, isovalue).first_hit({{-1, 1, 1}, {1, 0, 0}}).hit);
  EXPECT_TRUE(RootOracle(voxels, {3, 3, 3}, above).first_hit({{-1, 1, 1}, {1, 0, 0}}).hit);
  EXPECT_FALSE(RootOracle(voxels, {3, 3, 3}, std::nextafter(above, 2.0f))
                   .first_hit({{-1, 1, 1}, {1, 0, 0}})
                   .hit);
}

TEST(RootOracle, BeginsAnywhereOnARay) {
  // |x - 4| along x from -2: inside up to x = 2.5, and from x = 5.5 on.
  const auto voxels = sampled({9, 3, 3}, [](double x, double, double) { return std::abs(x - 4); });
  const RootOracle oracle(voxels, {9, 3, 3}, 1.5f);
  const OracleRay ray{{-2, 1.25, 1.5}, {0.5, 0, 0}};
  for (const auto &[begin, t] : {std::pair(0.0, 9.0), std::pair(8.75, 9.0), std::pair(9.25, 15.0),
                                 std::pair(14.875, 15.0)}) {
    const OracleHit hit = oracle.first_hit(ray, begin);
    ASSERT_TRUE(hit.hit) << begin;
    EXPECT_NEAR(hit.t, t, 1e-13) << begin;
  }
  EXPECT_FALSE(oracle.first_hit(ray, 15.5).hit);
  EXPECT_FALSE(oracle.first_hit(ray, 100).hit);
  EXPECT_EQ(oracle.inside(ray, 8.75), true);
  EXPECT_EQ(oracle.inside(ray, 9), true);
  EXPECT_EQ(oracle.inside(ray, std::nextafter(9.0, 10.0)), false);
  EXPECT_EQ(oracle.inside(ray, std::nextafter(15.0, 10.0)), false);
  EXPECT_EQ(oracle.inside(ray, 15), true);
}

TEST(RootOracle, CellsWithoutDataHaveNoHit) {
  const auto none = std::numeric_limits<double>::quiet_NaN();
  const auto voxels =
      sampled({9, 3, 3}, [&](double x, double, double) { return x == 3 ? none : x; });
  const OracleRay ray{{-2, 1.25, 1.5}, {1, 0, 0}};
  EXPECT_FALSE(RootOracle(voxels, {9, 3, 3}, 2.5f).first_hit(ray).hit);
  EXPECT_NEAR(RootOracle(voxels, {9, 3, 3}, 4.5f).first_hit(ray).t, 6.5, 1e-13);
  const RootOracle oracle(voxels, {9, 3, 3}, 4.5f);
  EXPECT_EQ(oracle.inside(ray, 3.5), false);
  EXPECT_EQ(oracle.inside(ray, 4.5), std::nullopt);
  EXPECT_EQ(oracle.inside(ray, 7), true);
}

TEST(RootOracle, GradientIsTheFieldsDerivative) {
  const auto voxels = sampled(
      {3, 3, 3}, [](double x, double y, double z) { return 2 * x + 3 * y - z + x * y * z; });
  const RootOracle oracle(voxels, {3, 3, 3}, 0);
  const std::array<double, 3> p{0.3, 1.4, 0.8}, g = oracle.gradient(p);
  const double h = 1e-6;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::array<double, 3> q = p;
    q[axis] += h;
    EXPECT_NEAR(g[axis], (oracle.field(q) - oracle.field(p)) / h, 1e-5);
  }
}

}  // namespace
}  // namespace isowave::core
