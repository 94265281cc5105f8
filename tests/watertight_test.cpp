// The watertight test on devices, in small. What it must find is planted in mutants.cmake.

#include <gtest/gtest.h>

#include "core/paper/blocks_pipeline.hpp"
#include "reference/watertight_device.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

class WatertightOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void expect_no_leaks(const PipelinePtr &pipeline, RayBands bands) {
    const std::uint64_t rays = is_llvmpipe(GetParam()) ? 10'000 : 200'000;
    ocl::Device device(GetParam());
    const std::vector<WatertightResult> results =
        run_watertight_on(device, pipeline, rays, 20231, kDefaultSolver, bands);
    EXPECT_EQ(results.size(), 3u);
    for (const WatertightResult &result : results) {
      EXPECT_EQ(result.leaks, 0u) << result.surface;
      EXPECT_GE(result.rays, rays) << result.surface;
    }
  }
};

TEST_P(WatertightOnDevice, PipelineRays) {
  expect_no_leaks(rays_pipeline(), RayBands::kOne);
}

TEST_P(WatertightOnDevice, PipelineBlocks) {
  expect_no_leaks(blocks_pipeline(), RayBands::kOne);
}

TEST_P(WatertightOnDevice, LevelsOfDetail) {
  expect_no_leaks(rays_pipeline(), RayBands::kLevels);
}

INSTANTIATE_TEST_SUITE_P(Devices, WatertightOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
