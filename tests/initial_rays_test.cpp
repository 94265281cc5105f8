// core/initial_rays: each pixel's first block and the first wavefront, against a walk over every
// cell.

#include "core/paper/initial_rays.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/ray_cases.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

class InitialRaysOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void expect_first_blocks(const glm::uvec3 &dims, ImageSize size) {
    const uint num_pixels = static_cast<uint>(size.num_pixels());
    Wavefront rays(device_, {num_pixels});
    Compaction compaction(device_, num_pixels, 64);
    InitialRays initial_rays(device_, num_pixels);
    for (const CameraCase &c : camera_cases(dims)) {
      SCOPED_TRACE(fmt::format("{} x {} x {}, camera '{}'", dims.x, dims.y, dims.z, c.name));
      const FrameParams frame = case_frame(dims, c, size);
      rays.frame = frame;
      initial_rays(rays, compaction);
      const std::vector<uint> blocks = rays.ray_block_ids.read();
      std::vector<uint> active;
      for (uint pixel = 0; pixel < num_pixels; ++pixel) {
        const std::vector<uint> all = blocks_of_ray(frame, pixel);
        ASSERT_EQ(blocks[pixel], all.empty() ? ISO_INVALID_ID : all.front()) << "pixel " << pixel;
        if (!all.empty()) active.push_back(pixel);
      }
      ASSERT_EQ(rays.counts.read().front().next_active_count, active.size());
      std::vector<uint> got = rays.next_active_ray_ids.read();
      got.resize(active.size());
      ASSERT_EQ(first_difference(got, active), kNoDifference);
      for (const HitRecord &hit : rays.hits.read()) ASSERT_EQ(hit.t, INFINITY);
    }
  }

  ocl::Device device_{GetParam()};
};

TEST_P(InitialRaysOnDevice, SmallImages) {
  expect_first_blocks({5, 6, 7}, {3, 3});
}

TEST_P(InitialRaysOnDevice, FirstBlocks) {
  for (const glm::uvec3 dims : {glm::uvec3(38, 41, 35), glm::uvec3(5, 6, 7), glm::uvec3(2, 2, 2)}) {
    expect_first_blocks(dims, {61, 47});
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, InitialRaysOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
