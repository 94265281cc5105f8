// kernels_cl/portable/ray_state.h: what is packed comes out again, and no field reaches into
// another.

#include "kernels_cl/portable/ray_state.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace isowave::core {
namespace {

constexpr std::array kPixels = {0u, 1u, 12345u, ISO_MAX_RAYS / 2, ISO_MAX_RAYS - 1};
constexpr std::array kBlockIds = {0u, 1u, 54321u, ISO_MAX_BLOCK_IDS / 2, ISO_MAX_BLOCK_IDS - 2};
constexpr std::array kSides = {ISO_SIDE_UNKNOWN, ISO_SIDE_OUTSIDE, ISO_SIDE_INSIDE};

TEST(RayState, EntriesComeOutAsTheyWentIn) {
  std::set<uint> entries;
  for (const uint pixel : kPixels) {
    for (uint log_ahead = 0; log_ahead <= ISO_MAX_LOG_AHEAD; ++log_ahead) {
      for (const uint in_doubt : {0u, 1u}) {
        const uint entry = pack_entry(pixel, log_ahead, in_doubt);
        const RayEntry ray = unpack_entry(entry);
        EXPECT_EQ(ray.pixel, pixel);
        EXPECT_EQ(ray.log_ahead, log_ahead);
        EXPECT_EQ(ray.in_doubt, in_doubt);
        EXPECT_TRUE(entries.insert(entry).second) << "two rays have the same entry";
      }
    }
  }
}

/// The compaction that follows initial_rays, and benchmarks, take pixels for entries.
TEST(RayState, NewEntryOfPipelineBlocksIsThePixel) {
  for (const uint pixel : kPixels) EXPECT_EQ(pack_entry(pixel, 0, 0), pixel);
}

TEST(RayState, StandsComeOutAsTheyWentIn) {
  std::set<uint> stands = {ISO_INVALID_ID};
  for (const uint block_id : kBlockIds) {
    for (const uint side : kSides) {
      const uint stand = pack_stand(block_id, side);
      EXPECT_EQ(unpack_stand(stand).block_id, block_id);
      EXPECT_EQ(unpack_stand(stand).side, side);
      EXPECT_TRUE(stands.insert(stand).second) << "two stands are the same, or none";
    }
  }
}

/// Where there are no levels of detail, kernels take a stand for the block's id.
TEST(RayState, StandWithoutSideIsTheBlock) {
  for (const uint block_id : kBlockIds) EXPECT_EQ(pack_stand(block_id, ISO_SIDE_UNKNOWN), block_id);
}

TEST(RayState, LookAheadDoublesUpToTheMostThereIs) {
  uint log_ahead = 0;
  for (uint blocks = 1; blocks <= ISO_MAX_SPECULATION; blocks *= 2) {
    EXPECT_EQ(own_ahead(unpack_entry(pack_entry(3, log_ahead, 1))), blocks);
    log_ahead = further_ahead(log_ahead);
  }
  EXPECT_EQ(log_ahead, ISO_MAX_LOG_AHEAD);
  EXPECT_EQ(own_ahead({0, ISO_MAX_LOG_AHEAD, 0}), ISO_MAX_SPECULATION);
}

}  // namespace
}  // namespace isowave::core
