// core/march, pass by pass in whole frames: what has become of each ray, with the twin's hits and
// the blocks that are cached. Whole frames are in render_test.cpp and invariance_test.cpp.

#include "core/stages/march.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "tests/rays_world.hpp"
#include "tests/stage_support.hpp"
#include "tests/stage_world.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr float kIsovalue = 0.3f;

/// Where a ray stood before a pass.
struct Stand {
  RayEntry entry;
  uint block_id;
};

class MarchOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};

  void expect_frame(const glm::uvec3 &dims, ImageSize size, std::uint32_t spec_count,
                    uint num_slots = 0, uint group_size = RaysWorld::kGroupSize) {
    SCOPED_TRACE(fmt::format("{} x {} rays, {} slots, groups of {}", size.width, size.height,
                             num_slots, group_size));
    const test::TestVolume volume(dims, test::gyroid_field(11), 8);
    const Camera camera = orbit_cameras(volume.info(), 1).front();
    RaysWorld world(device_, volume, camera, size, kIsovalue, spec_count, num_slots, group_size);
    const std::vector<HitRecord> expected =
        test::twin_hits(volume, camera, size, kIsovalue, Normals::kCell);
    EXPECT_GT(test::num_hits(expected), 0u);
    expect_passes(world, expected);
  }

  /// From the first pass to the last. Returns how many rays were left in doubt, summed over passes.
  std::size_t expect_passes(RaysWorld &world, const std::vector<HitRecord> &expected) {
    std::size_t num_doubts = 0;
    Wavefront &rays = world.rays;
    world.start_rays(world.macrocells, rays);
    for (int pass = 0; world.counts().next_active_count != 0; ++pass) {
      const std::map<uint, Stand> before = stands(world);
      rays.open_pass();
      if (pass != 0) world.provide();
      world.march(world.macrocells, world.cache, rays);
      expect_pass(world, before, expected);
      if (pass == 0) {
        EXPECT_EQ(world.waiting(), world.first_blocks()) << "nothing is cached";
      }
      for (const RayEntry &entry : world.entries()) num_doubts += entry.in_doubt;
      world.request_ahead(world.macrocells, world.cache, rays);
      EXPECT_LT(pass, 2000);
      if (HasFailure()) break;
    }
    test::expect_same_hits(rays.hits.read(), expected, world.frame.view.width);
    return num_doubts;
  }

  static std::map<uint, Stand> stands(const RaysWorld &world) {
    const std::vector<uint> blocks = world.rays.ray_block_ids.read();
    std::map<uint, Stand> stands;
    for (const RayEntry &entry : world.entries())
      stands.emplace(entry.pixel, Stand{entry, blocks[entry.pixel]});
    return stands;
  }

  /// Each ray of `before` has hit, waits, or has left for good.
  static void expect_pass(const RaysWorld &world, const std::map<uint, Stand> &before,
                          const std::vector<HitRecord> &expected) {
    const std::map<uint, Stand> after = stands(world);
    const std::vector<HitRecord> hits = world.rays.hits.read();
    const std::vector<uint> slots = world.slots_by_block();
    uint num_hits = 0;
    for (const auto &[pixel, stood] : before) {
      SCOPED_TRACE(fmt::format("pixel {}", pixel));
      if (const auto ray = after.find(pixel); ray != after.end()) {
        ASSERT_EQ(hits[pixel].t, INFINITY) << "it waits";
        expect_wait(world, stood, ray->second, slots);
      } else {
        ASSERT_EQ(std::memcmp(&hits[pixel], &expected[pixel], sizeof(HitRecord)), 0)
            << "it has ended: t " << hits[pixel].t << ", not " << expected[pixel].t;
        num_hits += std::isfinite(hits[pixel].t);
      }
    }
    for (const auto &[pixel, stand] : after)
      ASSERT_TRUE(before.contains(pixel)) << pixel << " was not at work";
    const PassCounts counts = world.counts();
    EXPECT_EQ(counts.active_count, before.size());
    EXPECT_EQ(counts.hit_count, num_hits);
    EXPECT_GE(counts.granted_count, num_hits);
  }

  /// A ray waits at an active block not before that where it stood, of whose dual grid something is
  /// missing, unless it is in doubt. When it has moved, it looks twice as far ahead.
  static void expect_wait(const RaysWorld &world, const Stand &stood, const Stand &stands,
                          const std::vector<uint> &slots) {
    const std::vector<uint> &blocks = world.active_blocks[stands.entry.pixel];
    const auto from = std::ranges::find(blocks, stood.block_id);
    const auto to = std::find(from, blocks.end(), stands.block_id);
    ASSERT_NE(to, blocks.end()) << "it waits at block " << stands.block_id << ", and was at "
                                << stood.block_id;
    const bool is_complete =
        std::ranges::all_of(dual_grid_blocks(world.frame, stands.block_id),
                            [&](uint block) { return slots[block] != ISO_BLOCK_ABSENT; });
    ASSERT_TRUE(!is_complete || stands.entry.in_doubt != 0)
        << "it waits for nothing, at block " << stands.block_id;
    ASSERT_EQ(stands.entry.log_ahead,
              to == from ? stood.entry.log_ahead : further_ahead(stood.entry.log_ahead));
  }
};

TEST_P(MarchOnDevice, SmallFrame) {
  expect_frame({10, 9, 11}, {6, 5}, 4);
}

TEST_P(MarchOnDevice, EveryPassOfAFrame) {
  expect_frame({30, 27, 33}, {61, 47}, 1);
  expect_frame({30, 27, 33}, {61, 47}, 8);
  expect_frame({30, 27, 33}, {200, 3}, 64);
}

/// Some rays wait while others go on, and blocks are evicted that rays had been given.
TEST_P(MarchOnDevice, FewSlots) {
  expect_frame({30, 27, 33}, {11, 9}, 8, 40);
  expect_frame({30, 27, 33}, {5, 3}, 8, kMinCacheSlots);
}

/// On the diagonal, the field is a square that only touches the isovalue: float32 cannot tell
/// whether a ray there crosses the surface twice, or not at all.
TEST_P(MarchOnDevice, DoubtsAreSettledByTheNextPass) {
  const glm::uvec3 dims(18, 17, 19);
  const test::TestVolume volume(
      dims, [](const glm::dvec3 &p) { return (p.x - 8.5) * (p.y - 8.5); }, 32);
  const CameraCase c = camera_cases(dims)[11];
  ASSERT_EQ(c.name, "diagonal of a face");
  RaysWorld world(device_, volume, c.camera, {23, 17}, 0.0f, 8);
  EXPECT_GT(expect_passes(world, test::twin_hits(volume, c.camera, {23, 17}, 0.0f, Normals::kCell)),
            0u);
}

TEST_P(MarchOnDevice, GroupSizesDoNotMatter) {
  for (const uint group_size : kGroupSizes) expect_frame({30, 27, 33}, {61, 47}, 8, 0, group_size);
}

INSTANTIATE_TEST_SUITE_P(Devices, MarchOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
