// core/composite: results made up at random, against a plain loop over each ray's pairs.

#include "core/paper/composite.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/ray_state.h"
#include "tests/ray_cases.hpp"
#include "tests/stage_support.hpp"
#include "tests/stage_world.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr glm::uvec3 kDims(14, 14, 11);  // 4 x 4 x 3 blocks

class CompositeOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void expect_composite(ImageSize size, uint spec_count, uint one_in, uint seed) {
    for (const ClosestHit closest : {ClosestHit::kScan, ClosestHit::kAtomicMin}) {
      for (const uint per_ray : {0u, 1u})
        expect_composite(size, spec_count, one_in, seed, closest, per_ray);
    }
  }

  /// Rays, and what was found in the blocks of their lists.
  struct Found {
    std::vector<uint> active{};      ///< pixels, ascending
    std::vector<uint> states{};      ///< [pixel]; some have left the volume behind their last block
    std::vector<uint> pairs{};       ///< [ray][spec_count] blocks
    std::vector<PairHit> results{};  ///< of the pairs
  };

  /// In `one_in` results, one is a hit and one was not tested.
  static Found random_found(const FrameParams &frame, uint spec_count, uint one_in,
                            Random &random) {
    const uint num_pixels = frame.view.width * frame.view.height;
    Found found;
    for (uint pixel = 0; pixel < num_pixels && (found.active.size() + 1) * spec_count <= num_pixels;
         ++pixel) {
      if (random() % 3 != 0) found.active.push_back(pixel);
    }
    found.states.resize(num_pixels);
    for (uint &state : found.states) state = random() % 2 ? ISO_INVALID_ID : 1000 + random() % 1000;
    for (std::size_t a = 0; a < found.active.size(); ++a) {
      const uint length = random() % (spec_count + 1);
      for (uint k = 0; k < spec_count; ++k) {
        found.pairs.push_back(k < length ? random() % (4 * 4 * 3) : ISO_INVALID_ID);
        const uint kind = random() % one_in;
        PairHit result{ISO_NO_HIT, 0.0f};
        if (kind == 1 || found.pairs.back() == ISO_INVALID_ID) result.cell = ISO_NOT_TESTED;
        if (kind == 0 && found.pairs.back() != ISO_INVALID_ID) {
          result = {random_cell(frame, found.pairs.back(), random),
                    static_cast<float>(random() >> 8) * 0x1p-24f};
        }
        found.results.push_back(result);
      }
    }
    return found;
  }

  void expect_composite(ImageSize size, uint spec_count, uint one_in, uint seed, ClosestHit how,
                        uint per_ray) {
    SCOPED_TRACE(fmt::format("{} x {}, spec count {}, one in {}, seed {}, {}, per ray {}",
                             size.width, size.height, spec_count, one_in, seed, to_string(how),
                             per_ray));
    Random random(seed);
    FrameParams frame = case_frame(kDims, camera_cases(kDims)[0], size, 0.3f);
    frame.schedule.per_ray_speculation = per_ray;
    const std::vector<float> voxels = random_voxels(kDims, -1, 1, seed);
    StageWorld world(device_, frame, 4 * 4 * 3, 8);
    fill_cache(world, voxels);

    const Found found = random_found(frame, spec_count, one_in, random);
    const auto &[active, all_states, pairs, results] = found;
    std::vector<uint> states = all_states;
    const uint num_pixels = static_cast<uint>(size.num_pixels());
    std::vector<HitRecord> expected_hits(num_pixels, no_hit());
    world.rays.hits.write(expected_hits);
    world.rays.ray_block_ids.write(states);
    world.rays.pair_hits.write(results);
    std::vector<uint> entries = active;  // some rays look ahead already
    for (uint &entry : entries) entry = pack_entry(entry, random() % (ISO_MAX_LOG_AHEAD + 1), 0);
    world.set_active(entries);
    world.begin_pass(pairs, spec_count);
    if (how == ClosestHit::kAtomicMin) offer_results(world, pairs, results, spec_count);
    PassCounts expected_counts = world.counts();

    Composite composite(device_, num_pixels, how);
    composite(world.cache, world.rays, world.compaction);

    std::vector<uint> next;
    for (std::size_t a = 0; a < active.size(); ++a) {
      bool goes_on = states[active[a]] != ISO_INVALID_ID, moves = true;
      for (std::size_t pair = a * spec_count; pair < (a + 1) * spec_count; ++pair) {
        if (pairs[pair] == ISO_INVALID_ID) break;
        if (results[pair].cell == ISO_NO_HIT) continue;
        if (results[pair].cell == ISO_NOT_TESTED) {  // wait here, whatever lies behind
          states[active[a]] = pairs[pair];
          goes_on = true;
          moves = pair != a * spec_count;
        } else {
          expected_hits[active[a]] = host_hit(frame, voxels, active[a], pairs[pair], results[pair]);
          ++expected_counts.hit_count;
          goes_on = false;
        }
        break;
      }
      uint ahead = unpack_entry(entries[a]).log_ahead;
      if (per_ray && moves) ahead = std::min(ahead + 1, ISO_MAX_LOG_AHEAD);
      if (goes_on) next.push_back(pack_entry(active[a], ahead, 0));
    }
    expected_counts.next_active_count = static_cast<uint>(next.size());
    expect_counts(world.rays.counts, expected_counts);
    std::vector<uint> got_next = world.rays.next_active_ray_ids.read();
    got_next.resize(next.size());
    EXPECT_EQ(first_difference(got_next, next), kNoDifference) << "of rays that go on";
    EXPECT_EQ(first_difference(world.rays.ray_block_ids.read(), states), kNoDifference)
        << "of states";
    const std::vector<HitRecord> hits = world.rays.hits.read();
    for (uint pixel = 0; pixel < num_pixels; ++pixel) {
      ASSERT_EQ(std::memcmp(&hits[pixel], &expected_hits[pixel], sizeof(HitRecord)), 0)
          << "pixel " << pixel << ": t " << hits[pixel].t << ", not " << expected_hits[pixel].t;
    }
  }

  /// What grouping and intersection leave in closest_pairs.
  static void offer_results(StageWorld &world, const std::vector<uint> &pairs,
                            const std::vector<PairHit> &results, uint spec_count) {
    std::vector<uint> closest(world.rays.num_rays, ISO_INVALID_ID);
    for (uint pair = 0; pair < pairs.size(); ++pair) {
      if (pairs[pair] == ISO_INVALID_ID || results[pair].cell == ISO_NO_HIT) continue;
      closest[pair / spec_count] = std::min(closest[pair / spec_count], pair);
    }
    world.rays.closest_pairs.write(closest);
  }

  /// A pass that asks for every block.
  static void fill_cache(StageWorld &world, const std::vector<float> &voxels) {
    const uint num_rays = static_cast<uint>(world.rays.num_rays);
    for (uint first = 0; first < 4 * 4 * 3; first += num_rays) {
      std::vector<uint> pairs;
      for (uint b = first; b < std::min(first + num_rays, 4u * 4 * 3); ++b) pairs.push_back(b);
      world.begin_pass(pairs, 1);
      world.cache.request(world.rays);
      world.assign_slots();
      world.fill_slots(voxels);
    }
  }

  static uint random_cell(const FrameParams &frame, uint block, Random &random) {
    const uint x = 4 * (block % frame.grid.blocks_x),
               y = 4 * (block / frame.grid.blocks_x % frame.grid.blocks_y),
               z = 4 * (block / frame.grid.blocks_x / frame.grid.blocks_y);
    return random() % std::min(4u, frame.grid.dims_x - 1 - x) +
           4 * (random() % std::min(4u, frame.grid.dims_y - 1 - y)) +
           16 * (random() % std::min(4u, frame.grid.dims_z - 1 - z));
  }

  static HitRecord host_hit(const FrameParams &frame, const std::vector<float> &voxels, uint pixel,
                            uint block, PairHit result) {
    const Ray ray = make_ray(&frame, pixel);
    const LastPlanes last = last_planes(&frame);
    const int x = int(4 * (block % frame.grid.blocks_x) + result.cell % 4),
              y = int(4 * (block / frame.grid.blocks_x % frame.grid.blocks_y) +
                      result.cell / 4 % 4),
              z = int(4 * (block / frame.grid.blocks_x / frame.grid.blocks_y) + result.cell / 16);
    const GridWalk cell = walk_from(&ray, x, y, z, 1, last);
    return make_hit(&frame, &ray, cell_corners(frame, voxels, x, y, z).data(), x, y, z,
                    region_entry(&ray, x, y, z, 1, last), walk_exit(&cell, &ray), result.s);
  }

  ocl::Device device_{GetParam()};
};

TEST_P(CompositeOnDevice, SmallImage) {
  expect_composite({6, 5}, 3, 3, 1);
}

TEST_P(CompositeOnDevice, EverySpeculationCount) {
  for (const uint spec_count : {1u, 2u, 3u, 7u, 63u, 64u}) {
    expect_composite({67, 31}, spec_count, 3, 10 + spec_count);
    expect_composite({67, 31}, spec_count, 40, 110 + spec_count);
  }
}

TEST_P(CompositeOnDevice, ManyRays) {
  expect_composite({301, 203}, 1, 4, 20);
  expect_composite({301, 203}, 5, 6, 21);
}

TEST_P(CompositeOnDevice, OneRay) {
  for (uint seed = 30; seed < 40; ++seed) expect_composite({1, 1}, 1, 3, seed);
}

/// No ray at work: nothing changes.
TEST_P(CompositeOnDevice, NoRays) {
  const FrameParams frame = case_frame(kDims, camera_cases(kDims)[0], {5, 5}, 0.3f);
  StageWorld world(device_, frame, 8, 8);
  world.rays.ray_block_ids.fill(17);
  world.set_active({});
  world.begin_pass({}, 1);
  const PassCounts before = world.counts();
  Composite composite(device_, 25);
  composite(world.cache, world.rays, world.compaction);
  expect_counts(world.rays.counts, before);
  EXPECT_EQ(world.rays.ray_block_ids.read(), std::vector<uint>(25, 17));
}

INSTANTIATE_TEST_SUITE_P(Devices, CompositeOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
