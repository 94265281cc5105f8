// core/start_and_march: a frame that it begins, over a cache with all, some or none of the blocks.

#include "core/stages/start_and_march.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>
#include <vector>

#include "tests/rays_world.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr float kIsovalue = 0.3f;

class StartAndMarchOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Draws a frame by start_rays and march, then once more by start_and_march.
  ///
  /// num_slots  0: one for each block
  /// cold       the cache is emptied between them
  /// Returns    how many of the second frame's rays wait after its first pass
  std::size_t expect_frame(const test::TestVolume &volume, const Camera &camera, ImageSize size,
                           uint num_slots = 0, bool cold = false,
                           uint group_size = RaysWorld::kGroupSize) {
    RaysWorld world(device_, volume, camera, size, kIsovalue, 4, num_slots, group_size);
    StartAndMarch start_and_march(device_, size.num_rays(), group_size, kDefaultSolver);
    Wavefront &rays = world.rays;
    world.start_rays(world.macrocells, rays);
    bool is_first = true;
    do {
      rays.open_pass();
      if (!std::exchange(is_first, false)) world.provide();
      world.march(world.macrocells, world.cache, rays);
      world.request_ahead(world.macrocells, world.cache, rays);
    } while (world.counts().next_active_count != 0);
    if (cold) world.cache.clear();
    const HitRecord stale = {1.0f, 2, 3, 4.0f, 5.0f, 6.0f, 7.0f, 8.0f, 9.0f};
    rays.hits.write(std::vector<HitRecord>(rays.num_rays, stale));
    const PassCounts last = world.counts();

    rays.open_pass();
    start_and_march(world.macrocells, world.cache, rays);

    const PassCounts counts = world.counts();
    EXPECT_EQ(counts.pass, last.pass + 1);
    EXPECT_EQ(counts.frame_pass, counts.pass);
    EXPECT_EQ(counts.last_frame_pass, last.frame_pass);
    EXPECT_EQ(counts.window_count, size.num_rays());
    const std::vector<HitRecord> expected =
        test::twin_hits(volume, camera, size, kIsovalue, Normals::kCell);
    expect_first_pass(world, expected);
    if (cold) {
      EXPECT_EQ(world.waiting(), world.first_blocks());
    }
    const std::size_t num_waiting = counts.next_active_count;
    for (int pass = 0; world.counts().next_active_count != 0; ++pass) {
      world.request_ahead(world.macrocells, world.cache, rays);
      rays.open_pass();
      world.provide();
      world.march(world.macrocells, world.cache, rays);
      EXPECT_LT(pass, 2000);
      if (HasFailure()) break;
    }
    test::expect_same_hits(rays.hits.read(), expected, world.frame.view.width);
    return num_waiting;
  }

  /// Each ray that meets an active block has ended as it should, or waits at an active block.
  static void expect_first_pass(const RaysWorld &world, const std::vector<HitRecord> &expected) {
    const std::map<uint, uint> waiting = world.waiting(), first = world.first_blocks();
    const std::vector<HitRecord> hits = world.rays.hits.read();
    uint num_hits = 0;
    for (uint pixel = 0; pixel < hits.size(); ++pixel) {
      SCOPED_TRACE(fmt::format("pixel {}", pixel));
      const HitRecord due = waiting.contains(pixel) ? no_hit() : expected[pixel];
      ASSERT_EQ(std::memcmp(&hits[pixel], &due, sizeof due), 0);
      num_hits += std::isfinite(hits[pixel].t);
    }
    for (const auto &[pixel, block] : waiting) {
      const std::vector<uint> &blocks = world.active_blocks[pixel];
      ASSERT_NE(std::ranges::find(blocks, block), blocks.end()) << "pixel " << pixel;
    }
    for (const RayEntry &entry : world.entries()) {
      const bool has_moved = waiting.at(entry.pixel) != first.at(entry.pixel);
      ASSERT_EQ(entry.log_ahead,
                has_moved ? further_ahead(ISO_FIRST_LOG_AHEAD) : ISO_FIRST_LOG_AHEAD);
    }
    EXPECT_EQ(world.counts().active_count, first.size());
    EXPECT_EQ(world.counts().hit_count, num_hits);
    EXPECT_GE(world.counts().granted_count, num_hits);
  }

  ocl::Device device_{GetParam()};
};

TEST_P(StartAndMarchOnDevice, SmallFrames) {
  const test::TestVolume volume({10, 9, 11}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  expect_frame(volume, camera, {7, 5});
  EXPECT_GT(expect_frame(volume, camera, {7, 5}, 0, true), 3u);
}

TEST_P(StartAndMarchOnDevice, CachesWithSomeOfTheBlocks) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  const std::size_t all = expect_frame(volume, camera, {61, 53}),
                    some = expect_frame(volume, camera, {61, 53}, 200),
                    none = expect_frame(volume, camera, {61, 53}, 0, true);
  EXPECT_LT(all, some) << "rays in doubt alone";
  EXPECT_LT(some, none);
}

TEST_P(StartAndMarchOnDevice, AwkwardCamerasAndSizes) {
  const glm::uvec3 dims(38, 41, 35);
  const test::TestVolume volume(dims, test::gyroid_field(15), 8);
  for (const CameraCase &c : camera_cases(dims)) {
    SCOPED_TRACE(c.name);
    expect_frame(volume, c.camera, {41, 27});
  }
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{200, 3}, ImageSize{21, 15, 3}}) {
    SCOPED_TRACE(fmt::format("{} x {}", size.width, size.height));
    expect_frame(volume, camera, size);
  }
  for (const uint group_size : kGroupSizes)
    expect_frame(volume, camera, {61, 47}, 0, false, group_size);
}

INSTANTIATE_TEST_SUITE_P(Devices, StartAndMarchOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
