// core/paper/block_triangles against its scalar twin, bit for bit; its vertices against those of
// meshes that share them.

#include "core/paper/block_triangles.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "core/stages/active_blocks.hpp"
#include "core/stages/prefix_sum.hpp"
#include "reference/mesh_twin.hpp"
#include "reference/raster_twin.hpp"
#include "tests/stage_world.hpp"
#include "tests/surface_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

/// Each vertex is within half a step of where it belongs, and its place is the same in every
/// triangle.
TEST(BlockTrianglesTwin, VerticesAreThoseOfTheMeshToHalfAStep) {
  const glm::uvec3 dims(11, 6, 9);
  const std::vector<float> voxels = coarse_noise(dims, 3);
  const BlockMesh mesh = extract_scalar(dims, voxels, 0.4f);
  const std::vector<BlockVertex> vertices = triangles_scalar(dims, voxels, 0.4f);
  ASSERT_EQ(vertices.size(), 3 * mesh.triangles.size());
  ASSERT_GT(vertices.size(), 1000u);
  const FrameParams grid = grid_frame(dims);
  std::map<uint, glm::uvec3> places;  // by number in the mesh
  // Half a step of 4 / 1023 voxel, and float32's rounding of a place below 4.
  const double half_step = 0.5 * 4 / 1023 + 0x1p-20;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const MeshTriangle &triangle = mesh.triangles[i / 3];
    const uint number = i % 3 == 0 ? triangle.a : i % 3 == 1 ? triangle.b : triangle.c;
    const LatticePoint p =
        lattice_point(block_coords(&grid, vertices[i].block_id), vertices[i].steps);
    const glm::uvec3 place(p.x, p.y, p.z);
    EXPECT_EQ(places.try_emplace(number, place).first->second, place) << "vertex " << number;
    const auto &[edge, t] = mesh.vertices[number];
    glm::dvec3 exact(4u * mesh.blocks[number] + glm::uvec3(edge & 3, edge >> 2 & 3, edge >> 4 & 3));
    exact[static_cast<int>(edge >> 6)] += t;
    for (int axis = 0; axis < 3; ++axis)
      ASSERT_NEAR(place[axis] * (4.0 / 1023), exact[axis], half_step) << "vertex " << number;
  }
}

TEST(BlockTrianglesTwin, StepsReachFromVoxelToVoxel) {
  for (const auto &[voxels, steps] :
       {std::pair(0.0f, 0u), {1.0f, 256u}, {2.0f, 512u}, {3.0f, 767u}, {4.0f, 1023u}}) {
    EXPECT_EQ(block_steps(voxels), steps);
    EXPECT_EQ(block_steps(std::nextafter(voxels, 2.0f)), steps);
  }
  const LatticePoint p = lattice_point({7, 8, 16383}, pack_steps(4, 0, 4));
  EXPECT_EQ(p.x, 1023u * 8);
  EXPECT_EQ(p.y, 1023u * 8);
  EXPECT_EQ(p.z, 1023u * 16384);
  EXPECT_LT(p.z, 1u << 24) << "float32 has it exactly";
}

class BlockTrianglesOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// All blocks cached at once; counted in pieces of `piece` blocks, and written in such.
  void expect_triangles(const glm::uvec3 &dims, const std::vector<float> &voxels, float isovalue,
                        uint piece) {
    SCOPED_TRACE(fmt::format("{}x{}x{}, isovalue {}, pieces of {}", dims.x, dims.y, dims.z,
                             isovalue, piece));
    const std::vector<BlockVertex> expected = triangles_scalar(dims, voxels, isovalue);
    CachedSurface cached(device_, dims, voxels, isovalue, Gradients::kNone);
    BlockTriangles triangles(device_);
    const uint num_listed = cached.num_listed;
    const FrameParams &frame = cached.world.rays.frame;
    ocl::Buffer<uint> offsets(device_, "offsets", num_listed + 1);
    for (uint begin = 0; begin < num_listed; begin += piece)
      triangles.count(frame, cached.world.cache, cached.block_ids,
                      {begin, std::min(num_listed, begin + piece), 0}, offsets);
    PrefixSum sum(device_, num_listed, 64);
    sum(offsets, num_listed);
    const std::vector<uint> all = offsets.read();
    ASSERT_EQ(3 * std::size_t{all.back()}, expected.size());
    for (uint begin = 0; begin < num_listed; begin += piece) {
      const uint end = std::min(num_listed, begin + piece);
      // Counts of their own, too, as if the list began here.
      ocl::Buffer<uint> own(device_, "offsets", end - begin + 1);
      triangles.count(frame, cached.world.cache, cached.block_ids, {begin, end, begin}, own);
      sum(own, end - begin);
      ASSERT_EQ(own.read().back(), all[end] - all[begin]);
      for (const bool with_own : {false, true}) {
        ocl::Buffer<BlockVertex> vertices(device_, "vertices", 3 * (all[end] - all[begin]));
        triangles.write(frame, cached.world.cache, cached.block_ids,
                        {begin, end, with_own ? begin : 0}, with_own ? own : offsets,
                        with_own ? 0 : all[begin], vertices);
        const std::vector<BlockVertex> got = vertices.read();
        for (std::size_t i = 0; i < got.size(); ++i) {
          const BlockVertex &want = expected[3 * std::size_t{all[begin]} + i];
          ASSERT_EQ(got[i].steps, want.steps) << "vertex " << i;
          ASSERT_EQ(got[i].block_id, want.block_id) << "vertex " << i;
        }
      }
    }
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, BlockTrianglesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(BlockTrianglesOnDevice, SmallNoiseEqualsTheTwin) {
  const glm::uvec3 dims(5, 3, 6);
  expect_triangles(dims, coarse_noise(dims, 1), 1.0f, 3);
  expect_triangles(dims, random_voxels(dims, -1, 1, 2), 0.1f, 100);
}

TEST_P(BlockTrianglesOnDevice, NoiseOfAnySize) {
  for (uint seed = 0; seed < (is_llvmpipe(GetParam()) ? 4u : 16u); ++seed) {
    Random random(seed);
    const glm::uvec3 dims(2 + random() % 30, 2 + random() % 30, 2 + random() % 30);
    const std::vector<float> voxels =
        seed % 2 == 0 ? coarse_noise(dims, seed) : random_voxels(dims, -1, 1, seed);
    expect_triangles(dims, voxels, seed % 2 == 0 ? 1.0f : 0.1f, 20 + random() % 100);
  }
}

TEST_P(BlockTrianglesOnDevice, NoSurface) {
  const glm::uvec3 dims(9, 9, 9);
  expect_triangles(dims, std::vector<float>(729, 1.0f), 2.0f, 100);
}

}  // namespace
}  // namespace isowave::core
