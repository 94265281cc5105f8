// core/group: pairs gathered by block, exactly those whose dual grid is cached, against plain
// loops, by either grouping.

#include "core/paper/group.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>
#include <set>
#include <vector>

#include "tests/stage_support.hpp"
#include "tests/stage_world.hpp"
#include "tests/test_groupings.hpp"

namespace isowave::core {
namespace {

constexpr glm::uvec3 kDims(29, 25, 22);  // 8 x 7 x 6 blocks

class GroupOnDevice : public testing::TestWithParam<GroupingOnDevice> {
 protected:
  /// How many pairs got their dual grids, of how many.
  struct Tally {
    std::size_t granted = 0, pairs = 0, blocks = 0;
  };

  /// Passes of random pairs; one block in `hot_one_in` pairs is the same hot block.
  Tally run_passes(uint num_slots, uint num_pixels, uint num_passes, uint hot_one_in,
                   uint group_size, uint seed) {
    SCOPED_TRACE(fmt::format("{} slots, {} pixels, hot 1 in {}, group size {}, seed {}", num_slots,
                             num_pixels, hot_one_in, group_size, seed));
    Random random(seed);
    const FrameParams frame = plain_frame(kDims, num_pixels);
    const uint num_blocks = frame.grid.blocks_x * frame.grid.blocks_y * frame.grid.blocks_z;
    StageWorld world(device_, frame, num_slots, group_size);
    Group group(device_, {num_pixels, num_slots, group_size, grouping_});
    Tally tally;
    for (uint pass = 0; pass < num_passes; ++pass) {
      SCOPED_TRACE(fmt::format("pass {}", pass));
      const uint spec_count = 1 + random() % 5;
      std::vector<uint> pairs((pass == 0 ? 1 : num_pixels / spec_count) * spec_count);
      const uint hot = random() % num_blocks;
      for (uint &pair : pairs) {
        const uint kind = random() % hot_one_in;
        pair = kind == 0 ? hot : (kind == 1 ? ISO_INVALID_ID : random() % num_blocks);
      }
      world.begin_pass(pairs, spec_count);
      world.cache.request(world.rays);
      world.assign_slots();
      group(world.cache, world.rays);
      check(world, group, pairs, tally);
      if (HasFatalFailure()) return tally;
    }
    return tally;
  }

  static void check(const StageWorld &world, const Group &group, const std::vector<uint> &pairs,
                    Tally &tally) {
    const std::vector<uint> table = world.slots_by_block();
    const auto granted = [&](uint pair) {
      if (pairs[pair] == ISO_INVALID_ID) return false;
      return std::ranges::all_of(dual_grid_blocks(world.frame, pairs[pair]),
                                 [&](uint block) { return table[block] < world.cache.num_slots; });
    };
    std::map<uint, std::set<uint>> expected;  // by slot
    std::size_t num_granted = 0;
    for (uint pair = 0; pair < pairs.size(); ++pair) {
      if (!granted(pair)) continue;
      expected[table[pairs[pair]]].insert(pair);
      ++num_granted;
    }
    const PassCounts counts = world.counts();
    ASSERT_EQ(counts.granted_count, num_granted);
    ASSERT_EQ(counts.visible_count, expected.size());
    /* Blocks that hold the pairs expected, each one, leave no room between them or behind. */
    const std::vector<uint> pair_ids = group.groups().pair_ids.read();
    const std::vector<BlockRays> block_rays = group.groups().block_rays.read();
    std::set<uint> seen;
    for (uint visible = 0; visible < counts.visible_count; ++visible) {
      const auto [begin, end] = block_rays[visible];
      ASSERT_LT(begin, end);
      ASSERT_LE(end, counts.granted_count);
      ASSERT_LT(pair_ids[begin], pairs.size());
      const uint slot = table[pairs[pair_ids[begin]]];
      ASSERT_TRUE(seen.insert(slot).second) << "slot " << slot << " has two groups";
      ASSERT_TRUE(expected.contains(slot));
      ASSERT_EQ(std::set<uint>(pair_ids.begin() + begin, pair_ids.begin() + end), expected[slot]);
      ASSERT_EQ(end - begin, expected[slot].size());
    }
    /* The other pairs are not tested, and each ray knows its first. */
    const std::vector<PairHit> hits = world.rays.pair_hits.read();
    std::vector<uint> closest(world.rays.num_rays, ISO_INVALID_ID);
    for (uint pair = 0; pair < pairs.size(); ++pair) {
      if (pairs[pair] == ISO_INVALID_ID || granted(pair)) continue;
      ASSERT_EQ(hits[pair].cell, ISO_NOT_TESTED) << pair;
      closest[pair / counts.spec_count] = std::min(closest[pair / counts.spec_count], pair);
    }
    ASSERT_EQ(first_difference(world.rays.closest_pairs.read(), closest), kNoDifference);
    tally.granted += num_granted;
    tally.pairs += pairs.size();
    tally.blocks += expected.size();
  }

  ocl::Device device_{GetParam().device};
  Grouping grouping_ = GetParam().grouping;
};

TEST_P(GroupOnDevice, SmallGroups) {
  run_passes(40, 40, 2, 4, 8, 1);
}

TEST_P(GroupOnDevice, AmpleSlotsGrantEveryPair) {
  for (const uint group_size : kGroupSizes) {
    const Tally tally = run_passes(8 * 7 * 6, 5000, 4, 3, group_size, 10);
    EXPECT_GT(tally.granted, tally.pairs / 2);
  }
}

TEST_P(GroupOnDevice, ScarceSlotsGrantSome) {
  for (const uint num_slots : {8u, 9u, 60u}) {
    const Tally tally = run_passes(num_slots, 1000, 10, 3, 64, 20);
    EXPECT_GT(tally.granted, 0u);
    EXPECT_LT(tally.granted, tally.pairs / 2);
  }
}

/// All blocks as pairs, with the dual grids of a few of them cached: many miss just one block, each
/// corner in turn.
TEST_P(GroupOnDevice, OneMissingBlockIsEnoughToWait) {
  const FrameParams frame = plain_frame(kDims, 8 * 7 * 6);
  std::vector<uint> all(8 * 7 * 6);
  std::iota(all.begin(), all.end(), 0u);
  std::set<std::size_t> sole_missing;  // corners
  Tally tally;
  Random random(40);
  for (uint trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE(fmt::format("trial {}, seed 40", trial));
    StageWorld world(device_, frame, 8 * 7 * 6, 64);
    Group group(device_, {8 * 7 * 6, 8 * 7 * 6, 64, grouping_});
    std::vector<uint> some;
    std::ranges::copy_if(all, std::back_inserter(some), [&](uint) { return random() % 5 == 0; });
    world.begin_pass(some, 1);
    world.cache.request(world.rays);
    world.assign_slots();
    const std::vector<uint> table = world.slots_by_block();
    for (const uint block : all) {
      const std::vector<uint> grid = dual_grid_blocks(frame, block);
      const auto absent = [&](uint b) { return table[b] == ISO_BLOCK_ABSENT; };
      if (grid.size() == 8 && std::ranges::count_if(grid, absent) == 1)
        sole_missing.insert(
            static_cast<std::size_t>(std::ranges::find_if(grid, absent) - grid.begin()));
    }
    world.begin_pass(all, 1);
    group(world.cache, world.rays);
    check(world, group, all, tally);
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(sole_missing.size(), 8u);
}

TEST_P(GroupOnDevice, OneHotBlock) {
  const Tally tally = run_passes(64, 20000, 3, 1, 64, 30);
  EXPECT_EQ(tally.granted, tally.pairs);
  EXPECT_EQ(tally.blocks, 3u);
}

/// More blocks, and more tiles of pairs, than work-groups take at once: each goes on with others.
TEST_P(GroupOnDevice, MoreVisibleBlocksThanOneSweepTakes) {
  constexpr uint kNumBlocks = 20 * 20 * 20, kNumPixels = 2 * kNumBlocks + 5;
  const FrameParams frame = plain_frame({80, 80, 80}, kNumPixels);
  StageWorld world(device_, frame, kNumBlocks, 8);
  Group group(device_, {kNumPixels, kNumBlocks, 8, grouping_});
  std::vector<uint> pairs(kNumPixels);
  Random random(50);
  Tally tally;
  for (const uint num_distinct : {kNumBlocks, kNumBlocks - 77, 3u}) {
    SCOPED_TRACE(fmt::format("{} blocks, seed 50", num_distinct));
    for (uint i = 0; i < kNumPixels; ++i) pairs[i] = i % num_distinct;
    std::ranges::shuffle(pairs, random);
    world.begin_pass(pairs, 1);
    world.cache.request(world.rays);
    world.assign_slots();
    group(world.cache, world.rays);
    check(world, group, pairs, tally);
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(tally.blocks, 2 * kNumBlocks - 77 + 3);
  EXPECT_EQ(tally.granted, tally.pairs);
}

TEST_P(GroupOnDevice, NoPairs) {
  const FrameParams frame = plain_frame(kDims, 10);
  StageWorld world(device_, frame, 8, 64);
  Group group(device_, {10, 8, 64, grouping_});
  world.begin_pass(std::vector<uint>(10, ISO_INVALID_ID), 1);
  group(world.cache, world.rays);
  EXPECT_EQ(world.counts().granted_count, 0u);
  EXPECT_EQ(world.counts().visible_count, 0u);
}

INSTANTIATE_TEST_SUITE_P(Devices, GroupOnDevice, testing::ValuesIn(groupings_under_test()),
                         grouping_test_name);

}  // namespace
}  // namespace isowave::core
