// The cell oracle against closed forms and the root oracle, and as judge of right and wrong frames.

#include "reference/cell_oracle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "reference/accuracy.hpp"
#include "reference/embree_reach.hpp"
#include "reference/root_oracle.hpp"
#include "reference/stability_suite.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core {
namespace {

using test::sample;
using Dims = std::array<std::uint32_t, 3>;

/// A ray whose numbers are float32, as a renderer's are.
OracleRay float_ray(const glm::dvec3 &origin, const glm::dvec3 &direction) {
  const glm::vec3 o(origin), d(direction);
  return {{o.x, o.y, o.z}, {d.x, d.y, d.z}};
}

glm::dvec3 random_direction(std::mt19937 &random) {
  std::normal_distribution<double> normal;
  return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
}

glm::dvec3 random_point(std::mt19937 &random, const Dims &dims) {
  std::uniform_real_distribution<double> uniform;
  return {uniform(random) * (dims[0] - 1), uniform(random) * (dims[1] - 1),
          uniform(random) * (dims[2] - 1)};
}

TEST(CellOracle, FindsAPlaneExactly) {
  const auto voxels = sample({9, 7, 5}, [](const glm::dvec3 &p) { return p.x; });
  const CellOracle oracle(voxels, {9, 7, 5}, 3.25f);
  EXPECT_EQ(oracle.num_cells(), 6u * 4u);
  const OracleHit hit = oracle.first_hit({{-2, 3.5, 1.5}, {0.5, 0.125, 0}});
  ASSERT_TRUE(hit.hit);
  EXPECT_NEAR(hit.t, 10.5, 1e-13);
  EXPECT_EQ(hit.cell, (std::array<int, 3>{3, 4, 1}));
  EXPECT_FALSE(oracle.first_hit({{-2, 3.5, 1.5}, {-0.5, 0, 0}}).hit);  // looks away
  EXPECT_FALSE(oracle.first_hit({{-2, 9, 1.5}, {1, 0, 0}}).hit);       // passes beside
}

TEST(CellOracle, FindsBothSheetsOfASaddle) {
  const auto voxels = sample({5, 5, 5}, [](const glm::dvec3 &p) { return (p.x - 2) * (p.y - 2); });
  const CellOracle oracle(voxels, {5, 5, 5}, 0);
  const OracleHit first = oracle.first_hit({{1, 1, 2}, {1, 1.5, 0}});
  ASSERT_TRUE(first.hit);
  EXPECT_NEAR(first.t, 2.0 / 3.0, 1e-14);
  const OracleHit second = oracle.first_hit({{1.75, 2.25, 2}, {1, 1.5, 0}});
  ASSERT_TRUE(second.hit);
  EXPECT_NEAR(second.t, 0.25, 1e-14);
}

TEST(CellOracle, FindsASphere) {
  // Trilinear interpolation of |p - c|^2 is too large by the variance of the corners' weights, at
  // most 3/4.
  const glm::dvec3 centre(24);
  const double radius = 20;
  const auto voxels = sample(
      glm::uvec3(49), [&](const glm::dvec3 &p) { return -glm::dot(p - centre, p - centre); });
  const CellOracle oracle(voxels, {49, 49, 49}, static_cast<float>(-radius * radius));
  std::mt19937 random(5);
  for (int i = 0; i < 500; ++i) {
    const glm::dvec3 eye = centre + 100.0 * random_direction(random);
    const glm::dvec3 direction = glm::normalize(centre + 18.0 * random_direction(random) - eye);
    const OracleRay ray = float_ray(eye, direction);
    const OracleHit hit = oracle.first_hit(ray);
    ASSERT_TRUE(hit.hit) << i;
    double r2 = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      r2 += std::pow(ray.origin[axis] + hit.t * ray.direction[axis] - 24, 2);
    EXPECT_LE(r2, radius * radius + 1e-9);
    EXPECT_GE(r2, radius * radius - 0.75 - 1e-9);
  }
}

TEST(CellOracle, StartingInsideIsAState) {
  const auto voxels =
      sample(glm::uvec3(17), [](const glm::dvec3 &p) { return 5 - glm::length(p - 8.0); });
  const CellOracle oracle(voxels, {17, 17, 17}, 0);
  const OracleHit leaves = oracle.first_hit({{8, 8, 8}, {1, 0, 0}});
  ASSERT_TRUE(leaves.hit);
  EXPECT_NEAR(leaves.t, 5, 1e-14);  // on the lattice line the field is linear between voxels
  const CellOracle all_inside(voxels, {17, 17, 17}, -100);
  EXPECT_FALSE(all_inside.first_hit({{-8, 8, 8}, {1, 0, 0}}).hit)
      << "the domain's border is no surface";
  EXPECT_EQ(all_inside.num_cells(), 0u);
}

TEST(CellOracle, CountsTheIsovalueAsInside) {
  // A plateau at the isovalue behind cells with corners below it: the change is at its first
  // voxels.
  const auto voxels = sample({9, 5, 5}, [](const glm::dvec3 &p) { return p.x < 3.5 ? 0 : 0.1f; });
  const CellOracle oracle(voxels, {9, 5, 5}, 0.1f);
  const OracleHit hit = oracle.first_hit({{-1, 1.7, 2.3}, {1, 0, 0}});
  ASSERT_TRUE(hit.hit);
  EXPECT_NEAR(hit.t, 5, 1e-14);
  EXPECT_FALSE(CellOracle(voxels, {9, 5, 5}, std::nextafter(0.1f, 1.0f))
                   .first_hit({{-1, 1.7, 2.3}, {1, 0, 0}})
                   .hit);
}

TEST(CellOracle, AgreesWithTheRootOracleInAllSignCases) {
  std::mt19937 random(256);
  std::uniform_real_distribution<float> uniform(0.05f, 1);
  int num_hits = 0;
  for (unsigned pattern = 0; pattern < 256; ++pattern) {
    std::vector<float> corners(8);
    for (unsigned i = 0; i < 8; ++i)
      corners[i] = (pattern >> i & 1u ? 1.0f : -1.0f) * uniform(random);
    const RootOracle roots(corners, {2, 2, 2}, 0);
    const CellOracle cells(corners, {2, 2, 2}, 0);
    for (int i = 0; i < 40; ++i) {
      const glm::dvec3 direction = random_direction(random);
      const OracleRay ray =
          float_ray(random_point(random, {2, 2, 2}) - 10.0 * direction, direction);
      const OracleHit expected = roots.first_hit(ray), got = cells.first_hit(ray);
      ASSERT_EQ(got.hit, expected.hit) << "pattern " << pattern << ", ray " << i;
      num_hits += expected.hit;
      if (!expected.hit) continue;
      EXPECT_NEAR(got.t, expected.t, 1e-11) << "pattern " << pattern << ", ray " << i;
    }
  }
  EXPECT_GT(num_hits, 1000);
}

/// Embree's float32 at the end of its reach: the enlarged bounds must still offer every cell.
TEST(CellOracle, AgreesWithTheRootOracleAtTheEndOfItsReach) {
  const Dims dims{33, 31, 29};
  const auto voxels = sample({33, 31, 29}, test::noise_field(3));
  const RootOracle roots(voxels, dims, 0.6f);
  const CellOracle cells(voxels, dims, 0.6f);
  std::mt19937 random(4);
  for (const double distance : {10.0, 3000.0, 30000.0, 65000.0}) {
    for (int i = 0; i < 2000; ++i) {
      const glm::dvec3 direction = random_direction(random);
      const OracleRay ray = float_ray(random_point(random, dims) - distance * direction, direction);
      const OracleHit expected = roots.first_hit(ray), got = cells.first_hit(ray);
      ASSERT_EQ(got.hit, expected.hit) << distance << ", ray " << i;
      if (!expected.hit) continue;
      EXPECT_EQ(got.cell, expected.cell) << distance << ", ray " << i;
      EXPECT_NEAR(got.t, expected.t, 1e-9) << distance << ", ray " << i;
    }
  }
}

TEST(CellOracle, AgreesWithTheRootOracleOnTheStabilitySuite) {
  std::uint64_t rays = 0, different = 0;
  for (const StabilityCase &stability_case : stability_cases(256, 77)) {
    SCOPED_TRACE(stability_case.name);
    for (const StabilityScene &scene : stability_case.scenes) {
      const RootOracle roots(scene.voxels, scene.dims, scene.isovalue);
      const CellOracle cells(scene.voxels, scene.dims, scene.isovalue);
      for (const Ray &ray : scene.rays) {
        const OracleRay exact = exact_ray(ray);
        if (!within_embree_reach(exact.origin, scene.dims)) continue;
        const OracleHit expected = roots.first_hit(exact), got = cells.first_hit(exact);
        ++rays;
        const bool same = got.hit == expected.hit &&
                          (!got.hit || std::abs(got.t - expected.t) * speed_of(exact) <= kSameHit);
        if (same) continue;
        ++different;
        // Only where the field touches the isovalue to within rounding: a little beside, both
        // answers occur.
        bool unstable = false;
        for (int i = 0; i < 8 && !unstable; ++i) {
          const OracleHit moved = roots.first_hit(moved_sideways(exact, 1e-5, i));
          unstable = moved.hit != expected.hit ||
                     (moved.hit && std::abs(moved.t - expected.t) * speed_of(exact) > kSameHit);
        }
        EXPECT_TRUE(unstable) << "root oracle " << expected.hit << " " << expected.t
                              << ", cell oracle " << got.hit << " " << got.t;
      }
    }
  }
  EXPECT_GT(rays, 3000u);
  RecordProperty("rays", std::to_string(rays));
  RecordProperty("different", std::to_string(different));
}

TEST(CellOracle, RefusesEyesOutOfEmbreesReach) {
  const Dims dims{33, 33, 33};
  EXPECT_TRUE(within_embree_reach({65536, 16, 16}, dims));
  EXPECT_FALSE(within_embree_reach({65537, 16, 16}, dims));
  EXPECT_TRUE(within_embree_reach({16, -65504, 16}, dims));  // 65,536 voxels from the plane y = 32
  EXPECT_FALSE(within_embree_reach({16, -65505, 16}, dims));
  const std::vector<float> voxels(33 * 33 * 33, 0.0f);
  const CellOracle oracle(voxels, dims, 1);
  EXPECT_THROW(oracle.first_hit({{1e5, 16, 16}, {-1, 0, 0}}), std::invalid_argument);
  EXPECT_NE(out_of_reach({1e5, 16, 16}, dims).find("100000 voxels"), std::string::npos);
}

TEST(CellOracle, RefusesVoxelsThatDoNotFit) {
  const std::vector<float> voxels(8, 0.0f);
  EXPECT_THROW(CellOracle(voxels, {2, 2, 3}, 0), std::invalid_argument);
  EXPECT_THROW(CellOracle(voxels, {8, 1, 1}, 0), std::invalid_argument);
}

/// A noise volume of odd dims, and a frame of it by the twin.
class CellOracleFrame : public testing::Test {
 protected:
  const test::TestVolume volume{{23, 19, 13}, test::noise_field(11)};
  const FrameParams frame = make_frame_params(
      volume.info(), test::camera_along({-10, 25, 30}, {21.5, -15.5, -24}), {64, 48}, 0.4f);
  const CellOracle oracle{volume.voxels, {23, 19, 13}, 0.4f};
  std::vector<HitRecord> hits = render_scalar(frame, volume.voxels);

  /// A hit well inside its cell, not at its block's lower border along x, and the nth of those.
  HitRecord &hit_in_cell(int n) {
    for (HitRecord &hit : hits) {
      const bool central =
          std::min({hit.x, hit.y, hit.z}) > 0.1f && std::max({hit.x, hit.y, hit.z}) < 0.9f;
      if (std::isfinite(hit.t) && central && (hit.cell & 3u) != 0 && n-- == 0) return hit;
    }
    throw std::logic_error("no such hit");
  }
};

TEST_F(CellOracleFrame, OfTheTwinIsRight) {
  const Accuracy tally = judge_frame(oracle, frame, hits);
  EXPECT_EQ(tally.rays, 64u * 48u);
  EXPECT_GT(tally.hits, 500u);
  EXPECT_EQ(tally.failures(), 0u);
  EXPECT_LT(quantiles(tally.distance).max, 1e-3);
  const Accuracy by_roots = judge_frame(RootOracle(volume.voxels, {23, 19, 13}, 0.4f), frame, hits);
  EXPECT_EQ(tally.hits, by_roots.hits);
}

TEST_F(CellOracleFrame, WithARemovedHitIsWrong) {
  hit_in_cell(5) = {INFINITY, ISO_INVALID_ID, ISO_INVALID_ID, 0, 0, 0, 0, 0, 0};
  const Accuracy tally = judge_frame(oracle, frame, hits);
  EXPECT_EQ(tally.missed, 1u);
  EXPECT_EQ(tally.failures(), 1u);
}

TEST_F(CellOracleFrame, WithAnInventedHitIsWrong) {
  const HitRecord hit = hit_in_cell(0);
  for (HitRecord &none : hits) {
    if (std::isfinite(none.t)) continue;
    none = hit;
    break;
  }
  EXPECT_EQ(judge_frame(oracle, frame, hits).false_hits, 1u);
}

TEST_F(CellOracleFrame, WithShiftedHitsIsWrong) {
  HitRecord &nearer = hit_in_cell(3);
  nearer.x += 0.05f;  // the first, so that shifting it cannot change which is the second
  HitRecord &other = hit_in_cell(9);
  other.x -= 0.05f;
  const Accuracy tally = judge_frame(oracle, frame, hits);
  EXPECT_EQ(tally.missed, 1u);
  EXPECT_EQ(tally.false_hits, 1u);
}

TEST_F(CellOracleFrame, WithANeighboursCellIsWrong) {
  HitRecord &hit = hit_in_cell(7);
  hit.cell -= 1;
  hit.x += 1;  // the same point, outside the cell it claims
  const Accuracy tally = judge_frame(oracle, frame, hits);
  EXPECT_EQ(tally.wrong_cells, 1u);
  EXPECT_EQ(tally.failures(), 1u);
}

TEST_F(CellOracleFrame, WithAnotherDepthIsWrong) {
  hit_in_cell(7).t *= 1 + 1e-5f;
  const Accuracy tally = judge_frame(oracle, frame, hits);
  EXPECT_EQ(tally.wrong_places, 1u);
  EXPECT_EQ(tally.failures(), 1u);
}

}  // namespace
}  // namespace isowave::core
