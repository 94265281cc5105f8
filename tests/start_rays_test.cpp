// core/start_rays: which rays a frame of pipeline `rays` begins with, and where, against a walk
// over every cell of every pixel's ray.

#include "core/stages/start_rays.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <map>

#include "kernels_cl/portable/cell_intersect.h"
#include "tests/rays_world.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr uint kUntouched = 0xABCDEF01u;
constexpr uint kLastPass = 41, kLastFramePass = 37;  ///< of the frame before, and where it began

class StartRaysOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};

  /// Returns how many rays start.
  std::size_t expect_start(const test::TestVolume &volume, const Camera &camera, ImageSize size,
                           float isovalue, uint group_size = RaysWorld::kGroupSize,
                           bool begins_frame = true) {
    RaysWorld world(device_, volume, camera, size, isovalue, 4, 0, group_size);
    Wavefront &rays = world.rays;
    const HitRecord stale = {1.0f, 2, 3, 4.0f, 5.0f, 6.0f, 7.0f, 8.0f, 9.0f};
    rays.hits.write(std::vector<HitRecord>(rays.num_rays, stale));
    rays.ray_block_ids.fill(kUntouched);
    rays.next_active_ray_ids.fill(kUntouched);
    PassCounts last = distinct_counts(), next = distinct_counts();
    last.frame_pass = kLastFramePass;
    last.next_active_count = 0;
    next.pass = kLastPass + 1;
    rays.counts.write({&last, 1});
    rays.next_counts.write({&next, 1});

    world.start_rays(world.macrocells, rays, begins_frame);

    const std::map<uint, uint> first = world.first_blocks();
    last.next_active_count = static_cast<uint>(first.size());
    if (begins_frame) {
      next.frame_pass = kLastPass + 1;
      next.last_frame_pass = kLastFramePass;
    }
    next.window_count = static_cast<uint>(size.num_rays());
    expect_counts(rays.counts, last);
    expect_counts(rays.next_counts, next);
    if (HasFailure()) return 0;
    EXPECT_EQ(world.waiting(), first);
    for (const RayEntry &entry : world.entries()) {
      EXPECT_EQ(entry.log_ahead, ISO_FIRST_LOG_AHEAD) << "pixel " << entry.pixel;
      EXPECT_EQ(entry.in_doubt, 0u) << "pixel " << entry.pixel;
    }
    expect_rest(rays, first);
    return first.size();
  }

  /// No ray has a hit; those that do not start have been left alone.
  static void expect_rest(const Wavefront &rays, const std::map<uint, uint> &started) {
    const HitRecord none = no_hit();
    const std::vector<HitRecord> hits = rays.hits.read();
    const std::vector<uint> blocks = rays.ray_block_ids.read(),
                            listed = rays.next_active_ray_ids.read();
    for (uint pixel = 0; pixel < hits.size(); ++pixel) {
      ASSERT_EQ(std::memcmp(&hits[pixel], &none, sizeof none), 0) << "hit of pixel " << pixel;
      if (!started.contains(pixel)) {
        ASSERT_EQ(blocks[pixel], kUntouched) << "pixel " << pixel;
      }
    }
    for (std::size_t i = started.size(); i < listed.size(); ++i)
      ASSERT_EQ(listed[i], kUntouched) << "entry " << i << " of " << started.size();
  }
};

TEST_P(StartRaysOnDevice, SmallPictures) {
  const test::TestVolume volume({10, 9, 11}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  EXPECT_GT(expect_start(volume, camera, {7, 5}, 0.3f, 8), 3u);
  EXPECT_GT(expect_start(volume, camera, {7, 5}, 0.3f, 8, false), 3u) << "within a frame";
  EXPECT_EQ(expect_start(volume, camera, {3, 1}, 1e6f, 8), 0u) << "nothing is active";
}

/// Hits are written as words, in fours: pictures that leave 1, 2, 3 and no words over.
TEST_P(StartRaysOnDevice, AwkwardSizes) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const ImageSize size :
       {ImageSize{61, 53}, ImageSize{46, 47}, ImageSize{61, 47}, ImageSize{64, 4}, ImageSize{1, 1},
        ImageSize{200, 3}, ImageSize{21, 15, 3}}) {
    SCOPED_TRACE(fmt::format("{} x {}", size.width, size.height));
    expect_start(volume, camera, size, 0.3f);
  }
}

TEST_P(StartRaysOnDevice, AwkwardCameras) {
  const glm::uvec3 dims(38, 41, 35);
  const test::TestVolume volume(dims, test::gyroid_field(15), 8);
  std::size_t num_started = 0;
  for (const CameraCase &c : camera_cases(dims)) {
    SCOPED_TRACE(c.name);
    num_started += expect_start(volume, c.camera, {41, 27}, 0.3f);
  }
  EXPECT_GT(num_started, 1000u);
}

TEST_P(StartRaysOnDevice, GroupSizesDoNotMatter) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const uint group_size : kGroupSizes)
    expect_start(volume, camera, {61, 47}, 0.3f, group_size);
}

INSTANTIATE_TEST_SUITE_P(Devices, StartRaysOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
