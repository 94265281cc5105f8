// Voxels without data in meshes, and in triangles that are drawn: no triangle touches them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "core/base/error.hpp"
#include "core/extract/extractor.hpp"
#include "core/paper/mesh_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "reference/mesh_twin.hpp"
#include "reference/raster_twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/mesh_checks.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::compressed;
using test::expect_same_hits;
using test::Hole;
using test::holes;
using test::NamedHole;
using test::TestVolume;
using test::with_hole;
using testing::HasSubstr;
using testing::ThrowsMessage;

class NoDataMeshes : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, NoDataMeshes, testing::ValuesIn(devices_under_test()),
                         device_test_name);

/// The triangles of a whole volume's mesh, as sets of corners, whose cell has data.
std::multiset<std::vector<float>> triangles_with_data(const Mesh &mesh, const glm::uvec3 &dims,
                                                      const Hole &hole) {
  std::multiset<std::vector<float>> kept;
  for (const Triangle &triangle : mesh.triangles) {
    std::vector<float> corners;
    glm::vec3 middle(0);
    for (const std::uint32_t vertex : triangle) {
      const glm::vec3 at = mesh.vertices[vertex];
      middle += at / 3.0f;
      corners.insert(corners.end(), {at.x, at.y, at.z});
    }
    const glm::uvec3 cell(glm::floor(middle));
    bool has_data = true;
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      const glm::uvec3 at = cell + glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2);
      has_data = has_data && !hole(glm::min(at, dims - 1u));
    }
    if (has_data) kept.insert(corners);
  }
  return kept;
}

/// What is left of the whole volume's mesh: it ends with an open border, and no vertex is left
/// over.
TEST_P(NoDataMeshes, SmallHolesAreCutOutOfTheMesh) {
  const glm::uvec3 dims(17, 14, 13);
  std::vector<float> source = test::sample(dims, test::noise_field(9));
  for (float &voxel : source) voxel = std::round(voxel * 100);  // exact with and without holes
  VolumeInfo info = test::grid_info(dims);
  info.type = VoxelType::kInt8;
  ocl::Device device(GetParam());
  const TestVolume whole(info, source, {.exact = true});
  const float isovalue = 10.5f;
  const Mesh all = extract_scalar(whole.compressed, isovalue);
  const Hole none = [](const glm::uvec3 &) { return false; };
  ASSERT_EQ(triangles_with_data(all, dims, none).size(), all.triangles.size());
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const TestVolume volume(info, with_hole(dims, source, hole.hole), {.exact = true});
    for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
      Extractor extractor(device, volume.compressed, {.stream = place});
      Mesh mesh;
      extractor.extract(isovalue, mesh);
      expect_same_mesh(mesh, extract_scalar(volume.compressed, isovalue));
      EXPECT_EQ(triangles_with_data(mesh, dims, none), triangles_with_data(all, dims, hole.hole));
      std::set<std::uint32_t> used;
      for (const Triangle &triangle : mesh.triangles) used.insert(triangle.begin(), triangle.end());
      EXPECT_EQ(used.size(), mesh.vertices.size());
    }
  }
}

TEST_P(NoDataMeshes, SmallDrawnTrianglesHaveTheTwinsBits) {
  const glm::uvec3 dims(17, 14, 13);
  constexpr ImageSize kSize{48, 32};
  ocl::Device device(GetParam());
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const TestVolume volume(test::grid_info(dims),
                            with_hole(dims, test::sample(dims, test::gyroid_field(9)), hole.hole),
                            16);
    MeshRenderer renderer(device, volume.compressed, {.size = kSize});
    const Camera camera = orbit_cameras(volume.info(), 3)[2];
    renderer.render({camera, 0.25f});
    expect_same_hits(renderer.hits(),
                     rasterise_scalar(make_frame_params(volume.info(), camera, kSize, 0.25f),
                                      triangles_scalar(dims, volume.voxels, 0.25f)),
                     kSize.width);
  }
}

/// The device's memory without them is what it was; programs built for them draw other volumes.
TEST_P(NoDataMeshes, SmallOtherVolumesAreDrawnAsBefore) {
  const glm::uvec3 dims(17, 14, 13);
  constexpr ImageSize kSize{24, 16};
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  const TestVolume full(test::grid_info(dims), source, 12),
      holed(test::grid_info(dims), with_hole(dims, source, holes(dims)[2].hole), 12);
  ocl::Device device(GetParam());
  const Camera camera = orbit_cameras(full.info(), 3)[2];
  const auto expected = test::twin_hits(full, camera, kSize, 0.25f);
  std::uint64_t bytes = 0;
  for (int turn = 0; turn < 2; ++turn) {
    DeviceRenderer renderer(device, full.compressed, {.size = kSize});
    renderer.render({camera, 0.25f});
    expect_same_hits(renderer.hits(), expected, kSize.width);
    if (turn == 0) bytes = device.ledger().current();
    EXPECT_EQ(device.ledger().current(), bytes);
    DeviceRenderer other(device, holed.compressed, {.size = kSize});
    EXPECT_EQ(device.ledger().current(), 2 * bytes + holed.compressed.no_data.table().size_bytes());
  }
  ocl::DeviceInfo without = GetParam();
  without.capabilities.nan = false;
  ocl::Device plain(without);
  EXPECT_NO_THROW(DeviceRenderer(plain, full.compressed, {.size = kSize}));
  EXPECT_THAT([&] { DeviceRenderer(plain, holed.compressed, {.size = kSize}); },
              ThrowsMessage<Error>(HasSubstr("has no NaN")));
}

}  // namespace
}  // namespace isowave::core
