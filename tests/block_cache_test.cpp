// core/block_cache over many passes and frames, against a model that knows when and how each slot
// was used last. Which block gets which slot is left to chance, so the model follows what the
// device chose and checks that it may.

#include "core/stages/block_cache.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "tests/stage_support.hpp"
#include "tests/stage_world.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr glm::uvec3 kDims(29, 25, 22);  // 8 x 7 x 6 blocks

/// What was cached, where, and when it was used last. Times are counted in halves of passes: 2 p +
/// 1 is when blocks are needed for what follows pass p, 2 p when they are read in it.
class CacheModel {
 public:
  CacheModel(const FrameParams &frame, uint num_slots)
      : frame_(frame), slots_(num_slots, ISO_INVALID_ID), used_(num_slots, 0) {}

  /// One pass on the device and here.
  void pass(StageWorld &world, const std::vector<uint> &pairs, uint spec_count) {
    world.begin_pass(pairs, spec_count);
    const uint pass = world.counts().pass;
    if (world.counts().frame_pass == pass) last_begin_ = std::exchange(frame_begin_, 2 * pass);
    now_ = 2 * pass + 1;
    world.cache.request(world.rays);
    check_requests(world, pairs);
    if (testing::Test::HasFatalFailure()) return;
    world.assign_slots();
    check_assignment(world, pairs);
    if (!testing::Test::HasFatalFailure()) check_touched(world);
  }

  /// Rays read in some of the cached blocks in the last pass, as march says it.
  void read_some(StageWorld &world, Random &random) {
    std::vector<uint> stamps = world.cache.slot_stamps.read();
    for (uint slot = 0; slot < slots_.size(); ++slot) {
      if (slots_[slot] != ISO_INVALID_ID && used_[slot] <= now_ && random() % 3 == 0)
        stamps[slot] = used_[slot] = now_ + 1;
    }
    world.cache.slot_stamps.write(stamps);
  }

  std::size_t num_granted = 0, num_refused = 0, num_stolen = 0, num_spared = 0, num_recycled = 0;

 private:
  bool cached(uint block) const { return std::ranges::find(slots_, block) != slots_.end(); }

  /// Requests are the missing blocks of all pairs' dual grids, once each; cached ones are stamped.
  void check_requests(const StageWorld &world, const std::vector<uint> &pairs) {
    wanted_.clear();
    for (const uint pair : pairs) {
      if (pair == ISO_INVALID_ID) continue;
      for (const uint block : dual_grid_blocks(frame_, pair)) {
        const auto at = std::ranges::find(slots_, block);
        if (at == slots_.end()) {
          wanted_.insert(block);
        } else {
          used_[static_cast<std::size_t>(at - slots_.begin())] = now_;
        }
      }
    }
    /* The list holds as many as there are slots; then, blocks may be counted more than once. */
    const std::size_t listed = std::min<std::size_t>(wanted_.size(), world.cache.capacity);
    ASSERT_GE(world.counts().requested_count, wanted_.size());
    ASSERT_TRUE(wanted_.size() > listed || world.counts().requested_count == wanted_.size());
    const std::vector<uint> list = world.cache.request_block_ids.read();
    const std::set<uint> requests(list.begin(), list.begin() + std::ptrdiff_t(listed));
    ASSERT_EQ(requests.size(), listed) << "a block is listed twice";
    ASSERT_TRUE(std::ranges::includes(wanted_, requests)) << "requests";
  }

  /// What was evicted is not of the first pair, and was used before all that was kept.
  ///
  /// slots       what they hold now
  /// into        the slots of the decode list
  /// first_grid  blocks of the pair served first
  void check_evictions(const StageWorld &world, const std::vector<uint> &slots,
                       const std::set<uint> &into, const std::set<uint> &first_grid) {
    const uint num_slots = static_cast<uint>(slots_.size());
    Order last_evicted{kEarlier, std::numeric_limits<int>::min()}, first_kept{kNever, 0};
    uint spared = 0, recycled = 0;
    find_last_uses();
    for (uint slot = 0; slot < num_slots; ++slot) {
      if (into.contains(slot)) {
        if (slots_[slot] != ISO_INVALID_ID) recycled += last_uses_[slot] >= frame_begin_;
        ASSERT_FALSE(first_grid.contains(slots_[slot])) << "a block of the first pair was evicted";
        if (slots_[slot] != ISO_INVALID_ID) last_evicted = std::max(last_evicted, order(slot));
      } else if (slots[slot] == ISO_INVALID_ID && slots_[slot] != ISO_INVALID_ID) {
        ASSERT_EQ(order(slot).first, kEarlier) << "freed without need, though still of use";
        last_evicted = std::max(last_evicted, order(slot));
        slots_[slot] = ISO_INVALID_ID;
        ++spared;
      } else {
        ASSERT_EQ(slots[slot], slots_[slot])
            << "slot " << slot << " changed and is not in the decode list";
        if (slots_[slot] != ISO_INVALID_ID && !first_grid.contains(slots_[slot]))
          first_kept = std::min(first_kept, order(slot));
      }
    }
    ASSERT_LE(spared, num_slots / 8);
    num_spared += spared;
    ASSERT_LE(last_evicted, first_kept) << "a block was evicted before one that was kept";
    ASSERT_EQ(world.counts().recycled_count, recycled);
    num_recycled += recycled;
  }

  void check_assignment(const StageWorld &world, const std::vector<uint> &pairs) {
    const uint num_slots = static_cast<uint>(slots_.size());
    const uint decoded = world.counts().decoded_count;
    const uint in_use = static_cast<uint>(std::ranges::count(used_, now_));
    std::set<uint> first_grid;  // blocks of the pair served first
    if (!pairs.empty() && pairs[0] != ISO_INVALID_ID) {
      for (const uint block : dual_grid_blocks(frame_, pairs[0])) first_grid.insert(block);
    }
    const auto first_missing = static_cast<uint>(
        std::ranges::count_if(first_grid, [&](uint block) { return !cached(block); }));
    /* Slots of this pass stay with it, but as many as the first pair needs are found in any case.
     */
    const std::size_t listed = std::min<std::size_t>(wanted_.size(), world.cache.capacity);
    ASSERT_EQ(decoded, std::min<std::size_t>(listed, std::max(num_slots - in_use, first_missing)));

    const std::vector<uint> table = world.slots_by_block(),
                            slots = world.cache.slot_block_ids.read(),
                            stream = world.cache.request_block_ids.read(),
                            targets = world.cache.decode_slots.read();
    /* The decode list: distinct blocks that were asked for, in distinct slots. */
    const std::set<uint> blocks(stream.begin(), stream.begin() + decoded),
        into(targets.begin(), targets.begin() + decoded);
    ASSERT_EQ(blocks.size(), decoded);
    ASSERT_EQ(into.size(), decoded);
    ASSERT_TRUE(std::ranges::includes(wanted_, blocks));
    check_evictions(world, slots, into, first_grid);
    if (testing::Test::HasFatalFailure()) return;
    const bool stole = std::ranges::any_of(into, [&](uint slot) { return used_[slot] == now_; });
    if (stole) {
      ASSERT_EQ(decoded, first_missing)
          << "slots of this pass were taken, and not for the first pair";
    }
    for (uint i = 0; i < decoded; ++i) {
      ASSERT_EQ(slots[targets[i]], stream[i]);
      slots_[targets[i]] = stream[i];
      used_[targets[i]] = now_;
    }
    /* Table and slots are inverse of each other. */
    test::expect_pages_of_cached_blocks(world.frame, world.cache.table.read());
    if (testing::Test::HasFatalFailure()) return;
    std::size_t num_cached = 0;
    for (uint block = 0; block < table.size(); ++block) {
      if (table[block] == ISO_BLOCK_ABSENT) continue;
      ASSERT_LT(table[block], num_slots) << "block " << block;
      ASSERT_EQ(slots[table[block]], block);
      ++num_cached;
    }
    ASSERT_EQ(num_cached, num_slots - std::ranges::count(slots, ISO_INVALID_ID));
    for (const uint block : first_grid)
      ASSERT_TRUE(cached(block)) << "block " << block << " of the first pair";
    /* When slots are scarce, what the first pair had already stays for a pass more. */
    for (uint slot = 0;
         slot < num_slots && wanted_.size() > std::min(num_slots - in_use, world.cache.capacity);
         ++slot) {
      if (first_grid.contains(slots_[slot]) && !into.contains(slot)) used_[slot] = now_ + 2;
    }
    num_granted += decoded;
    num_refused += wanted_.size() - decoded;
    num_stolen += stole;
  }

  /// What the pass has stamped, and with it, its dual grids.
  void check_touched(StageWorld &world) {
    std::set<uint> stamped, with_grids;
    for (uint slot = 0; slot < slots_.size(); ++slot) {
      if (slots_[slot] == ISO_INVALID_ID || used_[slot] < now_ - 1) continue;
      stamped.insert(slots_[slot]);
      for (const uint block : dual_grid_blocks(frame_, slots_[slot]))
        if (cached(block)) with_grids.insert(block);
    }
    world.cache.count_touched(world.rays, false);
    ASSERT_EQ(world.cache.touched_blocks(), stamped.size());
    world.cache.count_touched(world.rays, true);
    ASSERT_EQ(world.cache.touched_blocks(), with_grids.size());
  }

  /// Who reads in a block reads its dual grid. Not of blocks that are of this frame by their own
  /// stamp.
  void find_last_uses() {
    last_uses_ = used_;
    for (uint slot = 0; slot < slots_.size(); ++slot) {
      if (slots_[slot] == ISO_INVALID_ID) continue;
      for (const uint block : dual_grid_blocks(frame_, slots_[slot])) {
        const auto at = std::ranges::find(slots_, block) - slots_.begin();
        if (std::cmp_less(at, slots_.size())) {
          uint &last = last_uses_[static_cast<std::size_t>(at)];
          if (used_[static_cast<std::size_t>(at)] < frame_begin_)
            last = std::max(last, used_[slot] - used_[slot] % 2);
        }
      }
    }
  }

  /// What is evicted first is less. Greater ages than this count as it; in this frame and the last
  /// one, as about a fourth.
  static constexpr uint kOldest = 127;
  enum Class {
    kEarlier,
    kUnreadInLast,
    kReadInLast,
    kUnreadInFrame,
    kReadInFrame,
    kNeeded,
    kNever
  };
  using Order = std::pair<Class, int>;
  Order order(uint slot) const {
    const uint used = last_uses_[slot];
    const bool is_unread = used % 2 == 1;
    if (used >= now_) return {kNeeded, 0};
    const auto age_at = [used](uint time, uint oldest) {
      return static_cast<int>(std::min((time - used) / 2, oldest));
    };
    if (used < last_begin_) return {kEarlier, -age_at(last_begin_, kOldest)};
    if (used < frame_begin_)
      return {is_unread ? kUnreadInLast : kReadInLast, -age_at(frame_begin_, 31)};
    const int age = age_at(now_, 30);
    return is_unread ? Order{kUnreadInFrame, -age} : Order{kReadInFrame, age};
  }

  FrameParams frame_;
  std::vector<uint> slots_, used_, last_uses_;
  uint now_ = 0, last_begin_ = 0, frame_begin_ = 0;
  std::set<uint> wanted_;
};

class BlockCacheOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Random passes: each active ray asks for a row of neighbouring blocks that drifts from pass to
  /// pass.
  CacheModel run_passes(uint num_slots, uint num_pixels, uint num_passes, uint group_size,
                        uint seed) {
    SCOPED_TRACE(fmt::format("{} slots, {} pixels, group size {}, seed {}", num_slots, num_pixels,
                             group_size, seed));
    Random random(seed);
    const FrameParams frame = plain_frame(kDims, num_pixels);
    const uint num_blocks = frame.grid.blocks_x * frame.grid.blocks_y * frame.grid.blocks_z;
    StageWorld world(device_, frame, num_slots, group_size);
    CacheModel model(frame, num_slots);
    uint centre = 0;
    world.begin_frame();
    for (uint pass = 0; pass < num_passes; ++pass) {
      SCOPED_TRACE(fmt::format("pass {}", pass));
      const uint spec_count = 1u << random() % 4, active = 1 + random() % (num_pixels / spec_count);
      std::vector<uint> pairs;
      if (random() % 8 == 0) centre = random() % num_blocks;
      for (uint a = 0; a < active; ++a) {
        const uint length = random() % (spec_count + 1);  // 0: a ray that is leaving
        const uint begin = (centre + random() % 40) % num_blocks;
        for (uint k = 0; k < spec_count; ++k) {
          pairs.push_back(k < length && begin + k < num_blocks ? begin + k : ISO_INVALID_ID);
        }
      }
      if (random() % 5 == 0) world.begin_frame();
      model.pass(world, pairs, spec_count);
      if (HasFatalFailure()) return model;
      model.read_some(world, random);
    }
    return model;
  }

  ocl::Device device_{GetParam()};
};

TEST_P(BlockCacheOnDevice, SmallCache) {
  run_passes(8, 4, 3, 8, 1);
  run_passes(30, 8, 3, 8, 2);
}

TEST_P(BlockCacheOnDevice, ScarceSlots) {
  for (const uint group_size : kGroupSizes) {
    for (const uint num_slots : {8u, 9u, 17u}) {
      const CacheModel model = run_passes(num_slots, 24, 60, group_size, 10 + num_slots);
      EXPECT_GT(model.num_refused, 0u);
      EXPECT_GT(model.num_stolen, 0u)
          << "the first pair was never in need: the test tests too little";
    }
  }
}

TEST_P(BlockCacheOnDevice, ReplacementInTheOrderOfUse) {
  for (const uint num_slots : {64u, 100u, 200u}) {
    const CacheModel model = run_passes(num_slots, 40, 150, 64, 20 + num_slots);
    EXPECT_GT(model.num_granted, num_slots) << "nothing was replaced";
    EXPECT_GT(model.num_recycled, 0u) << "no frame needed more than there were slots";
  }
}

TEST_P(BlockCacheOnDevice, AmpleSlots) {
  const CacheModel model = run_passes(8 * 7 * 6, 300, 60, 64, 30);
  EXPECT_EQ(model.num_refused, 0u);
  EXPECT_LE(model.num_granted, 8u * 7 * 6) << "a block was decoded twice";
}

/// One ray after the other over all blocks, in a cache of one dual grid: each is served in its
/// pass.
TEST_P(BlockCacheOnDevice, OneDualGridOfSlotsServesEveryBlock) {
  const FrameParams frame = plain_frame(kDims, 3);
  StageWorld world(device_, frame, kMinCacheSlots, 64);
  CacheModel model(frame, kMinCacheSlots);
  const uint num_blocks = frame.grid.blocks_x * frame.grid.blocks_y * frame.grid.blocks_z;
  for (uint block = 0; block < num_blocks; ++block) {
    SCOPED_TRACE(fmt::format("block {}", block));
    model.pass(world, {block * 37 % num_blocks, block * 11 % num_blocks, block * 5 % num_blocks},
               1);
    if (HasFatalFailure()) return;
  }
}

/// Another number of slots: as a new cache, whatever was asked for before.
TEST_P(BlockCacheOnDevice, SmallCachesAreResized) {
  const FrameParams frame = plain_frame(kDims, 8);
  StageWorld world(device_, frame, 30, 8);
  const std::vector<uint> pairs{3, 70, 110, 200};
  uint last_slots = 0;
  for (const uint num_slots : {30u, 100u, 9u, 64u}) {
    SCOPED_TRACE(fmt::format("{} slots after {}", num_slots, last_slots));
    const BlockCache::Limits limits = BlockCache::limits_for(frame.grid, num_slots, 8);
    if (last_slots != 0) {
      world.cache.request(world.rays);  // of the last pass, and never answered
      world.cache.resize(limits);
      world.rays.reset_counts();
      world.set_frame(frame);
    }
    EXPECT_EQ(world.cache.num_slots, num_slots);
    EXPECT_EQ(world.cache.capacity, limits.max_requests());
    std::uint64_t bytes = 0;
    for (const ocl::BufferSize &size : BlockCache::sizes(limits))
      bytes += device_.ledger().by_name().at(size.name).current;
    EXPECT_EQ(bytes, BlockCache::sizes(limits).bytes());
    CacheModel model(frame, num_slots);
    world.begin_frame();
    for (int pass = 0; pass < 2; ++pass) {
      model.pass(world, pairs, 1);
      if (HasFatalFailure()) return;
    }
    last_slots = num_slots;
  }
  EXPECT_THAT([&] { world.cache.resize(BlockCache::limits_for(frame.grid, 7, 8)); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("7 slots")));
}

/// Ages of more passes than there are ranks.
TEST_P(BlockCacheOnDevice, AgesBeyondTheLastRank) {
  const FrameParams frame = plain_frame(kDims, 2);
  StageWorld world(device_, frame, 40, 64);
  CacheModel model(frame, 40);
  world.begin_frame();
  model.pass(world, {0, 5}, 1);
  for (uint pass = 0; pass < ISO_EVICTION_RANKS / 2 + 10; ++pass) {
    world.begin_frame();
    model.pass(world, {100, 100}, 1);
  }
  for (uint block = 200; block < 240; block += 2) {
    model.pass(world, {100, block}, 1);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(model.num_spared, 0u) << "slots out of use are freed ahead of need";
}

TEST_P(BlockCacheOnDevice, PassesWithoutRequestsChangeNothing) {
  const FrameParams frame = plain_frame(kDims, 2);
  StageWorld world(device_, frame, 16, 64);
  CacheModel model(frame, 16);
  model.pass(world, {7, 7}, 1);
  model.pass(world, {7, 7}, 1);
  EXPECT_EQ(world.counts().decoded_count, 0u);
  model.pass(world, {ISO_INVALID_ID, ISO_INVALID_ID}, 1);
  model.pass(world, {}, 1);
}

TEST_P(BlockCacheOnDevice, TooFewOrTooManySlotsAreRefused) {
  const FrameParams frame = plain_frame(kDims, 100);
  EXPECT_THROW(BlockCache(device_, BlockCache::limits_for(frame.grid, 7, 100), 64), Error);
  EXPECT_THROW(BlockCache(device_, BlockCache::limits_for(frame.grid, 0, 100), 64), Error);
  /* In kernels, 64 * slot must not overflow. */
  EXPECT_THAT(
      [&] { BlockCache(device_, BlockCache::limits_for(frame.grid, (1u << 26) + 1, 100), 64); },
      testing::ThrowsMessage<Error>(testing::HasSubstr("slots cannot be used")));
}

INSTANTIATE_TEST_SUITE_P(Devices, BlockCacheOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
