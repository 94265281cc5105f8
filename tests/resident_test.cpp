// The floor of the benchmarks draws what the pipelines draw: the twin's hit buffer, bit for bit.

#include "core/paper/resident.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/paper/blocks_pipeline.hpp"
#include "core/render/device_renderer.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::expect_same_hits;
using test::TestVolume;
using test::twin_hits;

constexpr ImageSize kSmall{13, 9};  // no whole number of tiles
constexpr ImageSize kMedium{96, 64};

class ResidentOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void SetUp() override {
    if (is_llvmpipe(device_.info()))
      GTEST_SKIP() << "a floor for benchmarks, for which llvmpipe would compile two minutes";
  }

  /// Draws all isovalues from all cameras. Returns the number of hits.
  std::uint64_t check(const TestVolume &volume, const std::vector<Camera> &cameras,
                      const std::vector<float> &isovalues, ImageSize size) {
    std::uint64_t hits = 0;
    Resident resident(device_, volume.compressed, size);
    for (const float isovalue : isovalues) {
      for (std::size_t view = 0; view < cameras.size(); ++view) {
        SCOPED_TRACE(fmt::format("isovalue {}, view {}", isovalue, view));
        EXPECT_GT(resident.render(cameras[view], isovalue), 0.0);
        const auto expected = twin_hits(volume, cameras[view], size, isovalue, Normals::kCell);
        expect_same_hits(resident.hits(), expected, size.width);
        hits += test::num_hits(expected);
      }
    }
    return hits;
  }
  std::uint64_t check(const TestVolume &volume, const std::vector<float> &isovalues,
                      ImageSize size) {
    return check(volume, orbit_cameras(volume.info(), 2), isovalues, size);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, ResidentOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

// ---- small enough for Oclgrind

TEST_P(ResidentOnDevice, SmallNoiseManySheets) {
  EXPECT_GT(check(TestVolume({9, 10, 11}, test::noise_field(3), 4), {0.6f}, kSmall), 20u);
}

TEST_P(ResidentOnDevice, SmallOneCellOneBlockAndThinVolumes) {
  for (const glm::uvec3 dims : {glm::uvec3(2, 2, 2), {4, 4, 4}, {5, 2, 9}, {2, 13, 6}}) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    const TestVolume volume(dims, test::noise_field(4), 16);
    EXPECT_GT(check(volume, {orbit_cameras(volume.info(), 1)[0]}, {0.1f}, kSmall), 5u);
  }
}

TEST_P(ResidentOnDevice, SmallEyeInside) {
  const TestVolume volume({9, 10, 11}, test::gyroid_field(7));
  EXPECT_GT(check(volume, {test::camera_along({4, 4.5, 5}, {1, 0.25, -0.5})}, {0.1f}, kSmall), 20u);
}

TEST_P(ResidentOnDevice, SmallNothingToHit) {
  const glm::uvec3 dims(9, 10, 11);
  const TestVolume volume(dims, test::sphere_field(dims));
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  EXPECT_EQ(check(volume, {camera}, {-5.0f, 5.0f}, kSmall), 0u);  // no block holds the isovalue
  const Camera away = test::camera_along(camera.eye, camera.eye - camera.at);
  EXPECT_EQ(check(volume, {away}, {0.5f}, kSmall), 0u);  // no ray meets the volume
}

// ---- larger

TEST_P(ResidentOnDevice, SheetsAndNoise) {
  EXPECT_GT(check(TestVolume({37, 30, 26}, test::gyroid_field(9)), {0.2f, -0.4f}, kMedium), 1000u);
  EXPECT_GT(check(TestVolume({19, 22, 17}, test::noise_field(8)), {0.7f, 0.0f}, kMedium), 1000u);
}

/// Flat steps at low rates: values near, at and beyond the isovalue, where float arithmetic is in
/// doubt.
TEST_P(ResidentOnDevice, Plateaus) {
  for (const std::uint32_t rate : {1u, 4u, 16u}) {
    SCOPED_TRACE(fmt::format("rate {}", rate));
    check(TestVolume({33, 30, 26}, test::plateau_field(), rate), {51, 102, 76.5f}, kMedium);
  }
}

TEST_P(ResidentOnDevice, EqualsBothPipelines) {
  const glm::uvec3 dims(62, 47, 53);
  const TestVolume volume(test::grid_info(dims, {1, 0.5, 2}),
                          test::sample(dims, test::gyroid_field(12)), 4);
  const Camera camera = orbit_cameras(volume.info(), 1)[0];
  Resident resident(device_, volume.compressed, kMedium);
  resident.render(camera, 0.3f);
  for (const PipelinePtr &pipeline : {blocks_pipeline(), rays_pipeline()}) {
    DeviceRenderer renderer(device_, volume.compressed, {.size = kMedium, .pipeline = pipeline});
    renderer.render({.camera = camera, .isovalue = 0.3f, .normals = Normals::kCell});
    expect_same_hits(resident.hits(), renderer.hits(), kMedium.width);
  }
}

TEST_P(ResidentOnDevice, SaysWhatDoesNotFit) {
  const TestVolume volume({9, 10, 11}, test::noise_field(3), 4);
  EXPECT_EQ(Resident::obstacle(device_, volume.compressed, kSmall), std::nullopt);
  CompressedVolume huge;
  huge.info.dims = glm::uvec3(16384);
  huge.bits_per_block = 256;
  EXPECT_THAT(Resident::obstacle(device_, huge, kSmall).value(),
              testing::HasSubstr("largest allocation"));
}

}  // namespace
}  // namespace isowave::core
