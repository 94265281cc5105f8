// core/stages/slot_type: which volumes have slots of integers; and that all that is drawn or
// extracted from such slots has the bits of the same volume in slots of float32.

#include "core/stages/slot_type.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/paper/mesh_renderer.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;

constexpr ImageSize kSize{13, 9};

std::vector<float> integers(const glm::uvec3 &dims) {
  std::vector<float> voxels = test::sample(dims, test::noise_field(5));
  for (float &voxel : voxels) voxel = std::rint(50 + 50 * voxel);
  return voxels;
}

CompressedVolume volume_of(VoxelType type, const glm::uvec3 &dims = {9, 10, 11}) {
  VolumeInfo info = test::grid_info(dims);
  info.type = type;
  return TestVolume(info, integers(dims), ErrorGoal{.exact = true}).compressed;
}

TEST(SlotType, IsThatOfShortIntegersWithoutALoss) {
  EXPECT_EQ(slot_type_for(volume_of(VoxelType::kUint8)), SlotType::kUint8);
  EXPECT_EQ(slot_type_for(volume_of(VoxelType::kInt8)), SlotType::kInt8);
  EXPECT_EQ(slot_type_for(volume_of(VoxelType::kUint16)), SlotType::kUint16);
  EXPECT_EQ(slot_type_for(volume_of(VoxelType::kInt16)), SlotType::kInt16);
  for (const VoxelType type : {VoxelType::kUint32, VoxelType::kInt32, VoxelType::kFloat32})
    EXPECT_EQ(slot_type_for(volume_of(type)), SlotType::kFloat32);
}

TEST(SlotType, IsFloatIfValuesMayBeOthers) {
  const CompressedVolume volume = volume_of(VoxelType::kUint8);
  const CompressedVolume *const levels[] = {&volume, &volume};
  EXPECT_EQ(slot_type_for(levels, false), SlotType::kUint8);
  EXPECT_EQ(slot_type_for(levels, true), SlotType::kFloat32) << "bounds";
  CompressedVolume means = volume;
  means.precision.whole_numbers = false;
  const CompressedVolume *const with_means[] = {&volume, &means};
  EXPECT_EQ(slot_type_for(with_means, false), SlotType::kFloat32);
  VolumeInfo info = test::grid_info({9, 10, 11});
  info.type = VoxelType::kUint8;
  const TestVolume at_a_rate(info, integers(info.dims), 8);
  EXPECT_EQ(slot_type_for(at_a_rate.compressed), SlotType::kFloat32);
}

class SlotTypeOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};
  const CompressedVolume short_ = volume_of(VoxelType::kUint8),
                         float_ = volume_of(VoxelType::kFloat32);
  const Camera camera_ = orbit_cameras(short_.info, 1)[0];
};
INSTANTIATE_TEST_SUITE_P(Devices, SlotTypeOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(SlotTypeOnDevice, AmbientAndGivenRays) {
  const RendererOptions options{.size = kSize, .with_given_rays = true};
  DeviceRenderer expected(device_, float_, options), got(device_, short_, options);
  ASSERT_LT(got.memory_plan().buffers["block cache"].bytes(),
            expected.memory_plan().buffers["block cache"].bytes());
  const FrameRequest request{.camera = camera_, .isovalue = 50, .ambient_rays = 3};
  EXPECT_GT(expected.render(request).rays_hit, 20u);
  got.render(request);
  expect_same_hits(got.hits(), expected.hits(), kSize.width);
  EXPECT_EQ(got.shade().pixels, expected.shade().pixels);
  const std::vector<WorldRay> rays = {{{-5, 4, 5}, {1, 0.2, 0.1}}, {{4, 4, -9}, {0.1, 0, 1}}};
  const auto hits = expected.cast_rays(rays, 50, Normals::kSmooth);
  EXPECT_GT(test::num_hits(hits), 0u);
  expect_same_hits(got.cast_rays(rays, 50, Normals::kSmooth), hits, 1);
}

TEST_P(SlotTypeOnDevice, Triangles) {
  MeshRenderer expected(device_, float_, {.size = kSize}), got(device_, short_, {.size = kSize});
  const FrameRequest request{.camera = camera_, .isovalue = 50, .normals = Normals::kCell};
  expected.render(request);
  got.render(request);
  EXPECT_GT(test::num_hits(expected.hits()), 20u);
  expect_same_hits(got.hits(), expected.hits(), kSize.width);
}

}  // namespace
}  // namespace isowave::core
