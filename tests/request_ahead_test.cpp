// core/request_ahead: what rays that wait ask for, against plain loops over them. Rays, look-aheads
// and cached blocks are random, so that also those occur that a frame would hardly bring about.

#include "core/stages/request_ahead.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "kernels_cl/portable/touched_blocks.h"
#include "tests/rays_world.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr uint kPass = 23, kOldStamp = 7, kUntouched = 0xABCDEF01u;

/// A ray that waits, and the rest of its active blocks, from the one that it stands at.
struct WaitingRay {
  RayEntry entry;
  std::vector<uint> blocks;
};

struct RequestCase {
  uint num_waiting = 0;    ///< at most those that meet an active block
  uint window = 0;         ///< 0: all rays of the frame
  bool per_ray = false;    ///< rays look ahead by numbers of their own
  uint one_cached_in = 4;  ///< blocks
  uint seed = 1;
};

/// What the stage must do.
struct Expected {
  std::set<uint> wanted;  ///< blocks that are not cached
  std::set<uint> needed;  ///< blocks that are
  PassCounts counts{};
  CacheState state{};
};

std::vector<WaitingRay> random_rays(const RaysWorld &world, uint most, Random &random) {
  std::vector<WaitingRay> rays;
  for (uint pixel = 0; pixel < world.active_blocks.size(); ++pixel) {
    const std::vector<uint> &all = world.active_blocks[pixel];
    if (all.empty()) continue;
    const auto at = std::ptrdiff_t(random() % all.size());
    rays.push_back(
        {{pixel, random() % (ISO_MAX_LOG_AHEAD + 1), random() % 2}, {all.begin() + at, all.end()}});
  }
  std::shuffle(rays.begin(), rays.end(), random);
  if (rays.size() > most) rays.resize(most);
  return rays;
}

/// Puts one block in `one_in` into the table; returns them. The first of a group takes a page.
std::set<uint> cache_some(RaysWorld &world, uint one_in, Random &random) {
  const uint num_slots = world.cache.num_slots;
  std::vector<uint> table(world.cache.table.size(), empty_page(num_slots));
  std::fill_n(table.begin(), page_count_at(num_slots, 0), ISO_BLOCK_ABSENT);
  uint num_pages = 0;
  std::set<uint> cached;
  for (uint block = 0; block < block_count(world.frame.grid); ++block) {
    if (random() % one_in != 0 || cached.size() == num_slots) continue;
    const glm::uvec3 b = world.coords(block);
    uint &page = table.at(directory_word(&world.frame, b.x, b.y, b.z));
    if (page == empty_page(num_slots)) page = num_pages++;
    table.at(page_word(&world.frame, page, b.x, b.y, b.z)) = static_cast<uint>(cached.size());
    cached.insert(block);
  }
  world.cache.table.write(table);
  world.cache.slot_stamps.fill(kOldStamp);
  return cached;
}

/// What the waiting rays leave to the stage. Arrays are written whole: see README "Devices",
/// Oclgrind.
void write_rays(RaysWorld &world, const std::vector<WaitingRay> &waiting,
                const PassCounts &counts) {
  std::vector<uint> entries(world.rays.num_rays, kUntouched), stands = entries;
  for (std::size_t i = 0; i < waiting.size(); ++i) {
    const RayEntry &entry = waiting[i].entry;
    entries[i] = pack_entry(entry.pixel, entry.log_ahead, entry.in_doubt);
    stands[entry.pixel] = pack_stand(waiting[i].blocks.front(), ISO_SIDE_UNKNOWN);
  }
  world.rays.next_active_ray_ids.write(entries);
  world.rays.ray_block_ids.write(stands);
  world.rays.counts.write({&counts, 1});
}

/// Blocks that a ray is to look ahead at (Sec. 4, and kernels_cl/portable/window.h).
uint ahead_of(const FrameParams &frame, const RequestCase &c, const RayEntry &entry,
              const PassCounts &counts) {
  const uint num_rays = frame.view.width * frame.view.height;
  const auto n_spec = [&](uint at_work) {
    return std::clamp(num_rays / at_work, 1u, frame.schedule.max_spec_count);
  };
  const uint own = std::min(1u << entry.log_ahead, frame.schedule.max_spec_count);
  uint ahead = n_spec(counts.next_active_count);
  if (c.per_ray) ahead = std::max(own, n_spec(counts.active_count) / 2);
  if (counts.window_count < num_rays) {
    const uint asking = std::min(counts.window_count, counts.next_active_count);
    ahead = std::min(ahead, std::max(1u, frame.schedule.cache_slots / (asking + 1)));
  }
  return ahead;
}

Expected expect(const RaysWorld &world, const RequestCase &c,
                const std::vector<WaitingRay> &waiting, const std::set<uint> &cached,
                const PassCounts &counts, const CacheState &state) {
  const FrameParams &frame = world.frame;
  const LastPlanes last = last_planes(&frame);
  Expected expected{{}, {}, counts, state};
  expected.counts.spec_count =
      waiting.empty() ? 0
                      : std::clamp(frame.view.width * frame.view.height / uint(waiting.size()), 1u,
                                   frame.schedule.max_spec_count);
  for (std::size_t i = 0; i < std::min<std::size_t>(waiting.size(), counts.window_count); ++i) {
    const WaitingRay &w = waiting[i];
    const uint ahead = ahead_of(frame, c, w.entry, counts);
    const Ray ray = make_ray(&frame, w.entry.pixel);
    expected.counts.ahead_count += ahead;
    for (std::size_t k = 0; k < std::min<std::size_t>(ahead, w.blocks.size()); ++k) {
      const glm::ivec3 b(world.coords(w.blocks[k]));
      const uint touched = touched_blocks(&ray, b.x, b.y, b.z, last);
      ++expected.counts.pair_count;
      if (i == 0 && k == 0) {
        expected.state.first_block_id = w.blocks[k];
        expected.state.first_touched = touched;
      }
      for (uint corner = 0; corner < 8; ++corner) {
        if ((touched >> corner & 1u) == 0) continue;
        const uint block =
            w.blocks[k] + (corner & 1) +
            frame.grid.blocks_x * ((corner >> 1 & 1) + frame.grid.blocks_y * (corner >> 2));
        (cached.contains(block) ? expected.needed : expected.wanted).insert(block);
      }
    }
  }
  return expected;
}

class RequestAheadOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};

  /// Returns how many blocks were asked for.
  std::size_t expect_requests(RaysWorld &world, const RequestCase &c) {
    Random random(c.seed);
    world.frame.schedule.per_ray_speculation = c.per_ray;
    world.rays.frame = world.frame;
    const std::vector<WaitingRay> waiting = random_rays(world, c.num_waiting, random);
    const std::set<uint> cached = cache_some(world, c.one_cached_in, random);
    PassCounts counts = distinct_counts();
    counts.pass = kPass;
    counts.next_active_count = static_cast<uint>(waiting.size());
    counts.active_count = counts.next_active_count + 5;
    counts.window_count = c.window != 0 ? c.window : static_cast<uint>(world.rays.num_rays);
    counts.requested_count = counts.pair_count = counts.ahead_count = 0;
    write_rays(world, waiting, counts);
    world.cache.requested_bits.fill(0);
    world.cache.request_block_ids.fill(kUntouched);
    CacheState state = {ISO_INVALID_ID, 55, 56, 57, 58, 59, 60, 61, 62, 63};
    world.cache.state.write({&state, 1});

    world.request_ahead(world.macrocells, world.cache, world.rays);

    const Expected expected = expect(world, c, waiting, cached, counts, state);
    check_requests(world, expected);
    check_cache(world, expected);
    return expected.wanted.size();
  }

  static void check_requests(const RaysWorld &world, Expected expected) {
    const uint requested = world.counts().requested_count, capacity = world.cache.capacity;
    if (expected.wanted.size() > capacity) {  // then, blocks may be counted more than once
      ASSERT_GE(requested, expected.wanted.size());
      expected.counts.requested_count = requested;
    } else {
      expected.counts.requested_count = static_cast<uint>(expected.wanted.size());
    }
    expect_counts(world.rays.counts, expected.counts);
    const std::size_t listed = std::min<std::size_t>(requested, capacity);
    const std::vector<uint> list = world.cache.request_block_ids.read();
    const std::set<uint> blocks(list.begin(), list.begin() + std::ptrdiff_t(listed));
    ASSERT_EQ(blocks.size(), listed) << "a block is listed twice";
    ASSERT_TRUE(std::ranges::includes(expected.wanted, blocks));
    for (std::size_t i = listed; i < list.size(); ++i) ASSERT_EQ(list[i], kUntouched) << i;
    const std::vector<uint> bits = world.cache.requested_bits.read();
    for (uint block = 0; block < block_count(world.frame.grid); ++block)
      ASSERT_EQ(world.has_bit(bits, block), blocks.contains(block)) << "mark of block " << block;
  }

  static void check_cache(const RaysWorld &world, const Expected &expected) {
    const std::vector<uint> slots = world.slots_by_block(), stamps = world.cache.slot_stamps.read();
    for (uint block = 0; block < slots.size(); ++block) {
      if (slots[block] == ISO_BLOCK_ABSENT) continue;
      ASSERT_EQ(stamps[slots[block]], expected.needed.contains(block) ? 2 * kPass + 1 : kOldStamp)
          << "of block " << block;
    }
    const CacheState state = world.cache.state.read().front();
    EXPECT_EQ(state.first_block_id, expected.state.first_block_id);
    EXPECT_EQ(state.first_touched, expected.state.first_touched);
    EXPECT_EQ(state.free_count, expected.state.free_count);
    EXPECT_EQ(state.granted, expected.state.granted);
  }
};

constexpr uint kAll = 1u << 30;

TEST_P(RequestAheadOnDevice, SmallRequests) {
  const test::TestVolume volume({10, 9, 11}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  RaysWorld world(device_, volume, camera, {7, 5}, 0.3f, 4, 0, 8);
  EXPECT_GT(expect_requests(world, {.num_waiting = 9, .per_ray = true}), 0u);
  EXPECT_EQ(expect_requests(world, {.num_waiting = 2, .one_cached_in = 1}), 0u) << "all is cached";
}

TEST_P(RequestAheadOnDevice, RaysOfAnyNumber) {
  const test::TestVolume volume({62, 54, 67}, test::gyroid_field(11), 4);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const uint most : {1u, 7u, 64u}) {
    RaysWorld world(device_, volume, camera, {61, 47}, 0.3f, most);
    for (const uint num_waiting : {0u, 1u, 2u, 5u, 100u, 333u, kAll}) {
      for (const bool per_ray : {false, true}) {
        SCOPED_TRACE(fmt::format("{} rays, at most {} blocks, per ray {}, seed {}", num_waiting,
                                 most, per_ray, num_waiting + 2));
        expect_requests(world,
                        {.num_waiting = num_waiting, .per_ray = per_ray, .seed = num_waiting + 2});
      }
    }
  }
}

TEST_P(RequestAheadOnDevice, OnlyRaysOfTheWindowAsk) {
  const test::TestVolume volume({62, 54, 67}, test::gyroid_field(11), 4);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  RaysWorld world(device_, volume, camera, {61, 47}, 0.3f, 64, 400);
  for (const uint window : {1u, 2u, 30u, 500u, 61u * 47u - 1, 61u * 47u}) {
    SCOPED_TRACE(fmt::format("window {}", window));
    expect_requests(world, {.num_waiting = 400, .window = window, .per_ray = true, .seed = 3});
    expect_requests(world, {.num_waiting = 400, .window = window, .one_cached_in = 2, .seed = 4});
  }
}

TEST_P(RequestAheadOnDevice, RequestsBeyondTheListAreForgotten) {
  const test::TestVolume volume({62, 54, 67}, test::gyroid_field(11), 4);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const uint num_slots : {8u, 31u}) {
    RaysWorld world(device_, volume, camera, {61, 47}, 0.3f, 16, num_slots);
    EXPECT_GT(expect_requests(world, {.num_waiting = kAll, .seed = 5}), num_slots);
  }
}

TEST_P(RequestAheadOnDevice, GroupSizesDoNotMatter) {
  const test::TestVolume volume({30, 27, 33}, test::gyroid_field(11), 8);
  const Camera camera = orbit_cameras(volume.info(), 1).front();
  for (const uint group_size : kGroupSizes) {
    SCOPED_TRACE(group_size);
    RaysWorld world(device_, volume, camera, {61, 47}, 0.3f, 64, 0, group_size);
    for (const uint num_waiting : {1u, 40u, kAll})
      expect_requests(world, {.num_waiting = num_waiting, .per_ray = true, .seed = 6});
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, RequestAheadOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
