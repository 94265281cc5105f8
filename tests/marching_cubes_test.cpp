// core/stages/marching_cubes against its scalar twin, bit for bit; the twin against what a mesh
// must be, and its gradients against those of portable/smooth_gradient.h.

#include "core/stages/marching_cubes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "core/stages/prefix_sum.hpp"
#include "kernels_cl/portable/smooth_gradient.h"
#include "reference/mesh_twin.hpp"
#include "tests/mesh_checks.hpp"
#include "tests/surface_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

Mesh unplaced(const BlockMesh &blocks, const glm::uvec3 &dims) {
  VolumeInfo info;
  info.dims = dims;
  const MeshPlacement placement(info, VertexPlaces::kApart);
  Mesh mesh;
  for (std::size_t i = 0; i < blocks.vertices.size(); ++i)
    mesh.vertices.push_back(placement.position(blocks.blocks[i], blocks.vertices[i]));
  for (const MeshTriangle &triangle : blocks.triangles)
    mesh.triangles.push_back(placement.triangle(triangle));
  return mesh;
}

TEST(MarchingCubesTwin, SurfacesOfNoiseAreClosed) {
  for (uint seed = 0; seed < 40; ++seed) {
    Random random(seed);
    const glm::uvec3 dims(2 + random() % 12, 2 + random() % 12, 2 + random() % 12);
    SCOPED_TRACE(fmt::format("{}x{}x{}, seed {}", dims.x, dims.y, dims.z, seed));
    const std::vector<float> voxels = coarse_noise(dims, seed);
    for (const float isovalue : {0.0f, 1.0f, -0.5f}) {
      const BlockMesh mesh = extract_scalar(dims, voxels, isovalue);
      ASSERT_FALSE(mesh.triangles.empty());
      expect_closed(unplaced(mesh, dims), dims);
    }
  }
}

/// Every cell by itself, as the volume of 2^3 voxels that it is.
TEST(MarchingCubesTwin, EachOf256CellsHasTheTableTriangles) {
  for (uint signs = 1; signs < 255; ++signs) {
    std::vector<float> voxels(8);
    for (uint corner = 0; corner < 8; ++corner)
      voxels[corner] = (signs >> corner & 1) != 0 ? 1 : -1;
    const BlockMesh mesh = extract_scalar({2, 2, 2}, voxels, 0);
    expect_closed(unplaced(mesh, {2, 2, 2}), {2, 2, 2});
    for (const MeshVertex &vertex : mesh.vertices) EXPECT_EQ(vertex.t, 0.5f);
  }
}

TEST(MarchingCubesTwin, VerticesAreWhereTheIsovalueIsCrossed) {
  EXPECT_EQ(edge_crossing(0, 1, 0.25f), 0.25f);
  EXPECT_EQ(edge_crossing(1, 0, 0.25f), 0.75f);
  EXPECT_EQ(edge_crossing(7, 3, 7), 0.0f);
  EXPECT_EQ(edge_crossing(3, 7, 7), 1.0f);
  const float most = std::numeric_limits<float>::max();
  EXPECT_EQ(edge_crossing(most, -most, 0), 0.5f) << "a difference overflows";
  EXPECT_EQ(edge_crossing(-most, most, 0.9f * most), 0.95f);
}

/// The gradient of a vertex, through smooth_derivative() of a cell that has its edge.
TEST(MarchingCubesTwin, GradientsAreTheSmoothOnesOfCells) {
  const glm::ivec3 dims(6, 5, 7);
  const std::vector<float> voxels = random_voxels(glm::uvec3(dims), -1, 1, 5);
  const BlockMesh mesh = extract_scalar(glm::uvec3(dims), voxels, 0.1f);
  const auto voxel = [&](int x, int y, int z) { return voxels[x + dims.x * (y + dims.y * z)]; };
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const uint edge = mesh.vertices[i].edge;
    glm::ivec3 lower =
        4 * glm::ivec3(mesh.blocks[i]) + glm::ivec3(edge & 3, edge >> 2 & 3, edge >> 4 & 3);
    glm::vec3 at(0);
    at[static_cast<int>(edge >> 6)] = mesh.vertices[i].t;
    for (int axis = 0; axis < 3; ++axis) {  // beyond the last cell: the one before, at its end
      if (lower[axis] == dims[axis] - 1) {
        --lower[axis];
        at[axis] = 1;
      }
    }
    const StencilAxis sx = stencil_axis(lower.x, dims.x - 1),
                      sy = stencil_axis(lower.y, dims.y - 1),
                      sz = stencil_axis(lower.z, dims.z - 1);
    std::array<float, 8> corners{}, beyond_x{}, beyond_y{}, beyond_z{};
    for (int c = 0; c < 8; ++c) {
      const glm::ivec3 p = lower + glm::ivec3(c & 1, c >> 1 & 1, c >> 2);
      corners.at(c) = voxel(p.x, p.y, p.z);
      beyond_x.at(c) = voxel((c & 1) != 0 ? sx.above : sx.below, p.y, p.z);
      beyond_y.at(c) = voxel(p.x, (c & 2) != 0 ? sy.above : sy.below, p.z);
      beyond_z.at(c) = voxel(p.x, p.y, (c & 4) != 0 ? sz.above : sz.below);
    }
    const CellPoint point = {at.x, at.y, at.z};
    const Gradient &got = mesh.gradients[i];
    ASSERT_EQ(got.x, smooth_derivative(corners.data(), beyond_x.data(), 1, sx, point)) << i;
    ASSERT_EQ(got.y, smooth_derivative(corners.data(), beyond_y.data(), 2, sy, point)) << i;
    ASSERT_EQ(got.z, smooth_derivative(corners.data(), beyond_z.data(), 4, sz, point)) << i;
  }
}

/// A sheet one voxel thick: central differences vanish at its voxels.
TEST(MarchingCubesTwin, ASheetHasTheGradientsOfItsEdges) {
  std::vector<float> voxels(27, 0.0f);
  for (std::size_t i = 9; i < 18; ++i) voxels[i] = 1;
  const BlockMesh mesh = extract_scalar({3, 3, 3}, voxels, 1.0f);
  ASSERT_EQ(mesh.gradients.size(), 18u);
  for (const Gradient &gradient : mesh.gradients) {
    EXPECT_EQ(gradient.x, 0);
    EXPECT_EQ(gradient.y, 0);
    EXPECT_NE(gradient.z, 0);
  }
}

class MarchingCubesOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// All blocks that hold the surface, cached at once, and written in pieces of `piece` blocks.
  void expect_mesh(const glm::uvec3 &dims, const std::vector<float> &voxels, float isovalue,
                   Gradients gradients, uint piece) {
    SCOPED_TRACE(fmt::format("{}x{}x{}, isovalue {}, pieces of {}", dims.x, dims.y, dims.z,
                             isovalue, piece));
    const BlockMesh expected = extract_scalar(dims, voxels, isovalue);
    CachedSurface cached(device_, dims, voxels, isovalue, gradients);
    StageWorld &world = cached.world;
    const FrameParams &frame = world.frame;
    ActiveBlocks &listed = cached.listed;
    const uint num_listed = cached.num_listed;
    SurfaceCounts surface(device_, num_listed);
    listed.list(frame, surface.block_ids);

    MarchingCubes cubes(device_, gradients);
    for (uint begin = 0; begin < num_listed; begin += piece)
      cubes.count(world.rays.frame, world.cache, begin, std::min(num_listed, begin + piece),
                  surface);
    PrefixSum sum(device_, num_listed, 64);
    sum(surface.vertex_offsets, num_listed);
    sum(surface.triangle_offsets, num_listed);
    const std::vector<uint> vertex_offsets = surface.vertex_offsets.read(),
                            triangle_offsets = surface.triangle_offsets.read(),
                            ids = surface.block_ids.read();
    ASSERT_EQ(vertex_offsets.back(), expected.vertices.size());
    ASSERT_EQ(triangle_offsets.back(), expected.triangles.size());
    for (uint begin = 0; begin < num_listed; begin += piece) {
      const uint end = std::min(num_listed, begin + piece);
      const uint first = vertex_offsets[begin], num_vertices = vertex_offsets[end] - first;
      const uint first_triangle = triangle_offsets[begin],
                 num_triangles = triangle_offsets[end] - first_triangle;
      MeshBuffers mesh(device_, num_vertices, num_triangles, gradients);
      cubes.write(world.rays.frame, world.cache, listed, begin, end, surface, mesh);
      const std::vector<MeshVertex> vertices = mesh.vertices.read();
      for (uint i = 0; i < num_vertices; ++i) {
        const MeshVertex &want = expected.vertices[first + i];
        const glm::uvec3 b = expected.blocks[first + i];
        ASSERT_EQ(vertices[i].edge & 255u, want.edge) << "vertex " << first + i;
        ASSERT_EQ(ids.at(begin + (vertices[i].edge >> ISO_VERTEX_BLOCK_SHIFT)),
                  b.x + frame.grid.blocks_x * (b.y + frame.grid.blocks_y * b.z));
        ASSERT_EQ(std::bit_cast<uint>(vertices[i].t), std::bit_cast<uint>(want.t));
      }
      if (gradients == Gradients::kSmooth) {
        const std::vector<float> got = mesh.gradients.read();
        ASSERT_TRUE(num_vertices == 0 || std::memcmp(got.data(), &expected.gradients[first],
                                                     got.size() * sizeof(float)) == 0);
      }
      const std::vector<MeshTriangle> triangles = mesh.triangles.read();
      ASSERT_TRUE(num_triangles == 0 ||
                  std::memcmp(triangles.data(), &expected.triangles[first_triangle],
                              triangles.size() * sizeof(MeshTriangle)) == 0);
    }
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, MarchingCubesOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(MarchingCubesOnDevice, SmallNoiseEqualsTheTwin) {
  const glm::uvec3 dims(5, 3, 6);
  expect_mesh(dims, coarse_noise(dims, 1), 1.0f, Gradients::kSmooth, 3);
  expect_mesh(dims, random_voxels(dims, -1, 1, 2), 0.1f, Gradients::kNone, 100);
}

TEST_P(MarchingCubesOnDevice, NoiseOfAnySize) {
  for (uint seed = 0; seed < (is_llvmpipe(GetParam()) ? 4u : 16u); ++seed) {
    Random random(seed);
    const glm::uvec3 dims(2 + random() % 30, 2 + random() % 30, 2 + random() % 30);
    const std::vector<float> voxels =
        seed % 2 == 0 ? coarse_noise(dims, seed) : random_voxels(dims, -1, 1, seed);
    expect_mesh(dims, voxels, seed % 2 == 0 ? 1.0f : 0.1f,
                seed % 4 < 2 ? Gradients::kSmooth : Gradients::kNone, 1 + random() % 100);
  }
}

TEST_P(MarchingCubesOnDevice, NoSurface) {
  const glm::uvec3 dims(9, 9, 9);
  expect_mesh(dims, std::vector<float>(729, 1.0f), 2.0f, Gradients::kSmooth, 100);
  expect_mesh(dims, std::vector<float>(729, 1.0f), 1.0f, Gradients::kSmooth, 100);
}

}  // namespace
}  // namespace isowave::core
