// The mesh oracle: closed surfaces, closed forms, and right and wrong frames.

#include "reference/mesh_oracle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/frame_scene.hpp"

namespace isowave::core {
namespace {

using test::sample;

/// Sum over triangles of the volume between them and the origin [voxels^3]: of a closed surface,
/// what it encloses, positive when its triangles are counter-clockwise from outside.
double enclosed_volume(const IsoMesh &mesh) {
  double sum = 0;
  for (const auto &triangle : mesh.triangles) {
    std::array<glm::dvec3, 3> p;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto &v = mesh.vertices[triangle[i]];
      p[i] = {v[0], v[1], v[2]};
    }
    sum += glm::dot(p[0], glm::cross(p[1], p[2])) / 6;
  }
  return sum;
}

TEST(IsoMesh, OfASphereIsClosed) {
  const auto voxels = sample({23, 25, 27}, [](const glm::dvec3 &p) {
    return 9 - glm::length(p - glm::dvec3(11, 12, 13));
  });
  const IsoMesh mesh = extract_isosurface(voxels, {23, 25, 27}, 0);
  EXPECT_GT(mesh.triangles.size(), 1000u);
  EXPECT_EQ(num_open_edges(mesh), 0u);
  // The chords of a field of slope 1 and curvature 1/r lie at most 3/4 / (2 r) inside.
  const double volume = 4.0 / 3.0 * 3.14159265358979 * 9 * 9 * 9, area = 3 * volume / 9;
  EXPECT_LT(enclosed_volume(mesh), volume);
  EXPECT_GT(enclosed_volume(mesh), volume - area * 0.75 / 18);
  // V - E + F = 2 for a sphere, with E = 3 F / 2.
  EXPECT_EQ(2 * mesh.vertices.size(), mesh.triangles.size() + 4);
}

TEST(IsoMesh, IsClosedInEverySignCase) {
  std::mt19937 random(8);
  std::uniform_real_distribution<float> uniform(0.05f, 1);
  for (unsigned pattern = 0; pattern < 256; ++pattern) {
    std::vector<float> voxels(4 * 4 * 4, -1.0f);
    unsigned i = 0;
    for (const unsigned at : {21u, 22u, 25u, 26u, 37u, 38u, 41u, 42u}) {  // the cell in the middle
      voxels[at] = (pattern >> i++ & 1u ? 1.0f : -1.0f) * uniform(random);
    }
    const IsoMesh mesh = extract_isosurface(voxels, {4, 4, 4}, 0);
    EXPECT_EQ(num_open_edges(mesh), 0u) << "pattern " << pattern;
    EXPECT_EQ(mesh.triangles.empty(), pattern == 0);
    EXPECT_GE(enclosed_volume(mesh), 0) << "pattern " << pattern;
  }
}

TEST(IsoMesh, OfNoiseAndPlateausIsClosed) {
  for (const bool plateaus : {false, true}) {
    const auto noise = test::noise_field(5);
    const auto voxels = sample({13, 12, 11}, [&](const glm::dvec3 &p) {
      const double value = plateaus ? std::round(2 * noise(p)) : noise(p);
      const bool border =
          glm::any(glm::lessThan(p, glm::dvec3(1))) || p.x > 11 || p.y > 10 || p.z > 9;
      return border ? -2 : value;
    });
    const IsoMesh mesh =
        extract_isosurface(voxels, {13, 12, 11}, 0);  // many voxels are equal to the isovalue
    EXPECT_GT(mesh.triangles.size(), 5000u);
    EXPECT_EQ(num_open_edges(mesh), 0u);
  }
}

TEST(IsoMesh, IsOpenWhereItLeavesTheVolume) {
  const auto voxels = sample({5, 4, 4}, [](const glm::dvec3 &p) { return p.x; });
  // 3 x 3 faces of a cell's cross section; each border edge of the sheet crosses 2 triangles of a
  // face's four.
  EXPECT_GT(num_open_edges(extract_isosurface(voxels, {5, 4, 4}, 2.25f)), 0u);
}

TEST(IsoMesh, RefusesVoxelsThatDoNotFit) {
  const std::vector<float> voxels(8, 0.0f);
  EXPECT_THROW(extract_isosurface(voxels, {2, 2, 3}, 0), std::invalid_argument);
  EXPECT_THROW(extract_isosurface(voxels, {8, 1, 1}, 0), std::invalid_argument);
}

TEST(MeshOracle, FindsAPlane) {
  const auto voxels = sample({9, 7, 5}, [](const glm::dvec3 &p) { return p.x; });
  const MeshOracle oracle(voxels, {9, 7, 5}, 3.25f);
  EXPECT_NEAR(oracle.first_hit({{-2, 3.5, 1.5}, {0.5, 0.125, 0}}), 10.5, 1e-5);
  EXPECT_EQ(oracle.first_hit({{-2, 3.5, 1.5}, {-0.5, 0, 0}}), kInfinity);  // looks away
  EXPECT_EQ(oracle.first_hit({{-2, 9, 1.5}, {1, 0, 0}}), kInfinity);       // passes beside
}

TEST(MeshOracle, FindsASaddle) {
  // (x - 2)(y - 2) = 0 is two planes between voxels, where the field is 0 at every node: triangles
  // lie in them.
  const auto voxels = sample({5, 5, 5}, [](const glm::dvec3 &p) { return (p.x - 2) * (p.y - 2); });
  const MeshOracle oracle(voxels, {5, 5, 5}, 0);
  EXPECT_NEAR(oracle.first_hit({{1, 1.125, 2.25}, {1, 1.5, 0}}), 0.875 / 1.5, 1e-6);
  EXPECT_NEAR(oracle.first_hit({{1.75, 2.25, 2.25}, {1, 1.5, 0}}), 0.25, 1e-6);
}

TEST(MeshOracle, FindsASphere) {
  // As for the cell oracle: linear interpolation over any corners is too large by their weights'
  // variance, at most 3/4.
  const auto voxels =
      sample(glm::uvec3(49), [](const glm::dvec3 &p) { return -glm::dot(p - 24.0, p - 24.0); });
  const MeshOracle oracle(voxels, {49, 49, 49}, -400);
  for (int i = 0; i < 200; ++i) {
    const double angle = 0.0314159 * i;
    const glm::dvec3 eye = 24.0 + 100.0 * glm::dvec3(std::cos(angle), 0.3, std::sin(angle));
    const glm::dvec3 direction = glm::normalize(
        glm::dvec3(24 + 15 * std::sin(3 * angle), 24, 24 + 5 * std::cos(angle)) - eye);
    const double t =
        oracle.first_hit({{eye.x, eye.y, eye.z}, {direction.x, direction.y, direction.z}});
    ASSERT_LT(t, kInfinity) << i;
    const glm::dvec3 at = eye + t * direction - 24.0;
    EXPECT_LE(glm::dot(at, at), 400 + 1e-3);  // float32: 2^-24 * 100 voxels, times twice the radius
    EXPECT_GE(glm::dot(at, at), 400 - 0.75 - 1e-3);
  }
}

TEST(MeshOracle, IsEmptyWithoutASurface) {
  const std::vector<float> voxels(27, 1.0f);
  const MeshOracle oracle(voxels, {3, 3, 3}, 2);
  EXPECT_EQ(oracle.num_triangles(), 0u);
  EXPECT_EQ(oracle.first_hit({{-2, 1, 1}, {1, 0, 0}}), kInfinity);
}

TEST(MeshOracle, RefusesEyesOutOfEmbreesReach) {
  const std::vector<float> voxels(27, 1.0f);
  const MeshOracle oracle(voxels, {3, 3, 3}, 2);
  EXPECT_THROW(oracle.first_hit({{1e5, 1, 1}, {-1, 0, 0}}), std::invalid_argument);
}

/// Every sign case in a single cell: the sheets that triangles connect differently must be
/// explained by refinement.
TEST(MeshOracle, AgreesWithTheTwinInAllSignCases) {
  std::mt19937 random(16);
  std::uniform_real_distribution<float> uniform(0.05f, 1);
  Accuracy tally;
  for (unsigned pattern = 0; pattern < 256; ++pattern) {
    std::vector<float> voxels(4 * 4 * 4, -0.5f);
    unsigned i = 0;
    for (const unsigned at : {21u, 22u, 25u, 26u, 37u, 38u, 41u, 42u}) {
      voxels[at] = (pattern >> i++ & 1u ? 1.0f : -1.0f) * uniform(random);
    }
    const MeshOracle oracle(voxels, {4, 4, 4}, 0);
    const Camera camera = test::camera_along({-4, 9, 7}, {5.5, -7.5, -5.5}, {0, 1, 0}, 30);
    const FrameParams frame =
        make_frame_params(test::grid_info(glm::uvec3(4)), camera, {12, 10}, 0);
    merge(tally, judge_frame(oracle, frame, render_scalar(frame, voxels)));
  }
  EXPECT_EQ(tally.failures(), 0u);
  EXPECT_GT(tally.hits, 1500u);
}

class MeshOracleFrame : public testing::Test {
 protected:
  Accuracy judge_hits(const test::TestVolume &volume, float isovalue,
                      const std::vector<HitRecord> &hits) {
    const glm::uvec3 dims = volume.info().dims;
    const MeshOracle oracle(volume.voxels, {dims.x, dims.y, dims.z}, isovalue);
    return judge_frame(oracle, frame(volume, isovalue), hits);
  }
  FrameParams frame(const test::TestVolume &volume, float isovalue) {
    return make_frame_params(volume.info(), test::camera_along({-10, 25, 32}, {21, -15, -22}),
                             {64, 48}, isovalue);
  }
  std::vector<HitRecord> twin(const test::TestVolume &volume, float isovalue) {
    return render_scalar(frame(volume, isovalue), volume.voxels);
  }
  /// The hit in the middle of the picture.
  HitRecord &middle(std::vector<HitRecord> &hits) { return hits[24 * 64 + 32]; }

  const test::TestVolume noise{{23, 19, 13}, test::noise_field(11)};
  const test::TestVolume sphere{{23, 23, 23}, test::sphere_field({23, 23, 23})};
};

TEST_F(MeshOracleFrame, OfTheTwinIsRight) {
  for (const test::TestVolume *volume : {&noise, &sphere}) {
    const Accuracy tally = judge_hits(*volume, 0.5f, twin(*volume, 0.5f));
    EXPECT_GT(tally.hits, 300u);
    EXPECT_EQ(tally.failures(), 0u);
    EXPECT_LE(quantiles(tally.distance).max, std::sqrt(3.0));
  }
}

TEST_F(MeshOracleFrame, WithARemovedHitIsWrong) {
  auto hits = twin(sphere, 0.5f);
  ASSERT_LT(middle(hits).t, INFINITY);
  middle(hits).t = INFINITY;
  EXPECT_EQ(judge_hits(sphere, 0.5f, hits).missed, 1u);
}

TEST_F(MeshOracleFrame, WithAnInventedHitIsWrong) {
  auto hits = twin(sphere, 0.5f);
  ASSERT_EQ(hits.front().t, INFINITY);
  hits.front() = middle(hits);
  EXPECT_EQ(judge_hits(sphere, 0.5f, hits).false_hits, 1u);
}

TEST_F(MeshOracleFrame, WithAHitInAnotherBlockIsWrong) {
  auto hits = twin(sphere, 0.5f);
  middle(hits).block_id += 1;
  const Accuracy tally = judge_hits(sphere, 0.5f, hits);
  EXPECT_EQ(tally.missed + tally.false_hits, 1u);
  EXPECT_EQ(tally.wrong_places, 1u) << "it is not on its ray";
}

/// Refinement excuses disagreements; on a noise volume, the worst case, lost hits must still be
/// seen.
TEST_F(MeshOracleFrame, SeesHolesEvenInNoise) {
  auto hits = twin(noise, 0.5f);
  const Accuracy before = judge_hits(noise, 0.5f, hits);
  std::uint64_t removed = 0;
  for (std::size_t i = 0; i < hits.size(); i += 3) {
    removed += std::isfinite(hits[i].t);
    hits[i].t = INFINITY;
  }
  const Accuracy after = judge_hits(noise, 0.5f, hits);
  EXPECT_GT(removed, 100u);
  EXPECT_GT(after.missed, removed * 3 / 5)
      << removed << " removed, unstable before " << before.unstable << ", after " << after.unstable;
}

}  // namespace
}  // namespace isowave::core
