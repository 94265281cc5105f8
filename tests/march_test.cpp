// core/march, stage by stage: which rays start and where, what they ask for, and when they hit.
// Whole frames are in render_test.cpp and invariance_test.cpp.

#include "core/stages/march.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/stages/request_ahead.hpp"
#include "core/stages/start_rays.hpp"
#include "core/stages/zfp_decode.hpp"
#include "kernels_cl/portable/ray_state.h"
#include "kernels_cl/portable/touched_blocks.h"
#include "tests/frame_scene.hpp"
#include "tests/ray_cases.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

constexpr uint kGroupSize = 64;
constexpr float kIsovalue = 0.3f;

/// A frame at its beginning, nothing cached.
struct MarchWorld {
  MarchWorld(ocl::Device &device, const test::TestVolume &test_volume, const Camera &camera,
             ImageSize size, std::uint32_t spec_count)
      : volume(test_volume),
        frame(make_frame_params(volume.info(), camera, size, kIsovalue)),
        stream(device, volume.compressed),
        macrocells(device, frame, stream),
        rays(device, {.num_rays = size.num_rays(), .with_pairs = false}),
        cache(device,
              BlockCache::limits_for(frame, static_cast<uint>(block_count(frame)), size.num_rays()),
              kGroupSize),
        decode(device, cache.capacity, stream.defines()),
        start_rays(device, size.num_rays(), kGroupSize),
        march(device, size.num_rays(), kGroupSize, kDefaultSolver),
        request_ahead(device, size.num_rays(), kGroupSize) {
    macrocells.select(frame);
    macrocells.set_index(frame);
    macrocells.set_active_box(frame);
    set_screen_box(frame);
    frame.max_spec_count = spec_count;
    frame.table_groups = cache.table_groups;
    rays.frame = frame;
    const std::vector<uint> masks = macrocells.masks().read();
    for (uint pixel = 0; pixel < size.num_rays(); ++pixel) {
      std::vector<uint> &list = active_blocks.emplace_back(blocks_of_ray(frame, pixel));
      std::erase_if(list, [&](uint block) { return !is_active(masks, block); });
    }
  }

  bool is_active(const std::vector<uint> &masks, uint block) const {
    const uint x = block % frame.blocks_x, y = block / frame.blocks_x % frame.blocks_y,
               z = block / frame.blocks_x / frame.blocks_y;
    const uint coarse_x = (frame.blocks_x + 3) / 4, coarse_y = (frame.blocks_y + 3) / 4;
    const uint bit = x % 4 + 4 * (y % 4) + 16 * (z % 4);
    return (masks[2 * (x / 4 + coarse_x * (y / 4 + coarse_y * (z / 4))) + bit / 32] >> bit % 32 &
            1u) != 0;
  }

  PassCounts counts() const { return rays.counts.read().front(); }

  /// The rays that go on, and the block that each stands at.
  std::map<uint, uint> waiting() const {
    std::vector<uint> entries(counts().next_active_count);
    rays.next_active_ray_ids.read(entries);
    const std::vector<uint> blocks = rays.ray_block_ids.read();
    std::map<uint, uint> waiting;
    for (const uint entry : entries)
      waiting.emplace(unpack_entry(entry).pixel, blocks[unpack_entry(entry).pixel]);
    EXPECT_EQ(waiting.size(), entries.size()) << "a ray is listed twice";
    return waiting;
  }

  std::map<uint, uint> first_blocks() const {
    std::map<uint, uint> first;
    for (uint pixel = 0; pixel < active_blocks.size(); ++pixel) {
      if (!active_blocks[pixel].empty()) first.emplace(pixel, active_blocks[pixel].front());
    }
    return first;
  }

  std::set<uint> requests() const {
    std::vector<uint> blocks(counts().requested_count);
    cache.request_block_ids.read(blocks);
    std::set<uint> distinct(blocks.begin(), blocks.end());
    EXPECT_EQ(distinct.size(), blocks.size()) << "a block is asked for twice";
    return distinct;
  }

  void provide() {
    cache.evict(rays.previous_counts, rays);
    cache.assign(rays.previous_counts, rays);
    decode({stream, rays.frame}, {stream, rays.frame}, rays.counts, cache);
  }

  const test::TestVolume &volume;
  FrameParams frame;
  DeviceStream stream;
  Macrocells macrocells;
  Wavefront rays;
  BlockCache cache;
  ZfpDecode decode;
  StartRays start_rays;
  March march;
  RequestAhead request_ahead;
  std::vector<std::vector<uint>> active_blocks;  ///< by pixel, in ray order
};

class MarchOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  ocl::Device device_{GetParam()};

  void expect_frame(const glm::uvec3 &dims, ImageSize size, std::uint32_t spec_count) {
    const test::TestVolume volume(dims, test::gyroid_field(11), 8);
    const Camera camera = orbit_cameras(volume.info(), 1).front();
    MarchWorld world(device_, volume, camera, size, spec_count);
    Wavefront &rays = world.rays;
    world.start_rays(world.macrocells, rays);
    const std::map<uint, uint> first = world.first_blocks();
    ASSERT_EQ(world.waiting(), first);
    for (const HitRecord &hit : rays.hits.read()) ASSERT_EQ(hit.t, INFINITY);

    rays.open_pass();
    world.march(world.macrocells, world.cache, rays);
    EXPECT_EQ(world.waiting(), first) << "nothing is cached: all wait where they stand";
    EXPECT_EQ(world.counts().hit_count, 0u);
    world.request_ahead(world.macrocells, world.cache, rays);
    EXPECT_EQ(world.requests(), touched_ahead(world, first, spec_count));

    std::uint64_t num_hits = 0;
    for (int pass = 0; world.counts().next_active_count != 0; ++pass) {
      ASSERT_LT(pass, 100);
      rays.open_pass();
      world.provide();
      world.march(world.macrocells, world.cache, rays);
      world.request_ahead(world.macrocells, world.cache, rays);
      num_hits += world.counts().hit_count;
    }
    const std::vector<HitRecord> expected = test::twin_hits(volume, camera, size, kIsovalue);
    test::expect_same_hits(rays.hits.read(), expected, size.width);
    EXPECT_EQ(num_hits, test::num_hits(expected));
    EXPECT_GT(num_hits, 0u);
  }

  /// The blocks of which rays cross cells, in as many active blocks of each as N_Spec says.
  static std::set<uint> touched_ahead(const MarchWorld &world, const std::map<uint, uint> &waiting,
                                      std::uint32_t most) {
    const FrameParams &frame = world.frame;
    const auto spec =
        std::clamp(frame.width * frame.height / static_cast<uint>(waiting.size()), 1u, most);
    const LastPlanes last = last_planes(&frame);
    std::set<uint> touched;
    for (const auto &[pixel, block_id] : waiting) {
      const std::vector<uint> &blocks = world.active_blocks[pixel];
      const Ray ray = make_ray(&frame, pixel);
      for (std::size_t i = 0; i < std::min<std::size_t>(spec, blocks.size()); ++i) {
        const uint x = blocks[i] % frame.blocks_x, y = blocks[i] / frame.blocks_x % frame.blocks_y,
                   z = blocks[i] / frame.blocks_x / frame.blocks_y;
        const uint corners = touched_blocks(&ray, int(x), int(y), int(z), last);
        for (uint corner = 0; corner < 8; ++corner) {
          if ((corners >> corner & 1u) != 0)
            touched.insert(x + (corner & 1) +
                           frame.blocks_x *
                               (y + (corner >> 1 & 1) + frame.blocks_y * (z + (corner >> 2))));
        }
      }
    }
    return touched;
  }
};

TEST_P(MarchOnDevice, SmallFrame) {
  expect_frame({10, 9, 11}, {6, 5}, 4);
}

TEST_P(MarchOnDevice, StartsAsksAndHits) {
  expect_frame({30, 27, 33}, {61, 47}, 1);
  expect_frame({30, 27, 33}, {61, 47}, 8);
  expect_frame({30, 27, 33}, {200, 3}, 64);
}

INSTANTIATE_TEST_SUITE_P(Devices, MarchOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
