// Components and Euler's characteristic of meshes, by surfaces whose topology is known.

#include "reference/mesh_topology.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/mesh/host_extractor.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core {
namespace {

using test::TestVolume;

Mesh mesh_of(const glm::uvec3 &dims, const test::VoxelFunction &field, float isovalue = 0) {
  const VolumeInfo info = test::grid_info(dims);
  const TestVolume volume(info, test::sample(dims, field),
                          ErrorGoal{.tolerance = {}, .exact = true});
  Mesh mesh;
  extract_on_host(volume.compressed, isovalue, {.with_normals = false}, mesh);
  return mesh;
}

double torus(const glm::dvec3 &p) {
  const double ring = std::hypot(p.x - 16, p.y - 16) - 9;
  return 4 - std::hypot(ring, p.z - 16);
}

TEST(MeshTopology, KnowsSpheresAndHandles) {
  const MeshComponents sphere = components_of(
      mesh_of({33, 33, 33}, [](const glm::dvec3 &p) { return 10 - glm::length(p - 16.0); }));
  EXPECT_EQ(sphere.count(), 1u);
  EXPECT_EQ(sphere.euler, 2);
  const MeshComponents ring = components_of(mesh_of({33, 33, 33}, torus));
  EXPECT_EQ(ring.count(), 1u);
  EXPECT_EQ(ring.euler, 0);
  const MeshComponents shell = components_of(mesh_of(
      {33, 33, 33}, [](const glm::dvec3 &p) { return 2 - std::abs(glm::length(p - 16.0) - 10); }));
  EXPECT_EQ(shell.count(), 2u) << "inner and outer wall";
  EXPECT_EQ(shell.euler, 4);
  const MeshComponents wall =
      components_of(mesh_of({9, 9, 9}, [](const glm::dvec3 &p) { return p.x - 4.5; }));
  EXPECT_EQ(wall.count(), 1u);
  EXPECT_EQ(wall.euler, 1) << "a disk";
  EXPECT_EQ(components_of(Mesh{}).count(), 0u);
}

TEST(MeshTopology, FindsComponentsThatAreLost) {
  const auto ball = [](const glm::dvec3 &p, const glm::dvec3 &at, double radius) {
    return radius - glm::length(p - at);
  };
  const glm::uvec3 dims(41, 25, 25);
  const Mesh two = mesh_of(dims, [&](const glm::dvec3 &p) {
    return std::max(ball(p, {10, 12, 12}, 6), ball(p, {30, 12, 12}, 3));
  });
  const Mesh one = mesh_of(dims, [&](const glm::dvec3 &p) { return ball(p, {10, 12, 12}, 6.5); });
  const VolumeInfo info = test::grid_info(dims);
  const MeshComponents of_two = components_of(two), of_one = components_of(one);
  ASSERT_EQ(of_two.count(), 2u);
  const std::vector<bool> lost = lacking(two, of_two, one, info, 1);
  ASSERT_EQ(std::ranges::count(lost, true), 1);
  const auto which = static_cast<std::size_t>(std::ranges::find(lost, true) - lost.begin());
  EXPECT_LT(of_two.num_triangles[which], of_two.num_triangles[1 - which]) << "the small one";
  EXPECT_EQ(lacking(one, of_one, two, info, 1), std::vector<bool>{false});
  EXPECT_EQ(lacking(two, of_two, {}, info, 1), (std::vector<bool>{true, true}));
  EXPECT_EQ(lacking(two, of_two, one, info, 64), (std::vector<bool>{false, false}));
}

}  // namespace
}  // namespace isowave::core
