#pragma once
// A frame of pipeline `rays` on a device, for tests that run its stages one by one: start_rays,
// march, request_ahead.

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <vector>

#include "core/render/block_store.hpp"
#include "core/stages/march.hpp"
#include "core/stages/request_ahead.hpp"
#include "core/stages/start_and_march.hpp"
#include "core/stages/start_rays.hpp"
#include "kernels_cl/portable/ray_state.h"
#include "tests/cache_table.hpp"
#include "tests/frame_scene.hpp"
#include "tests/ray_cases.hpp"

namespace isowave::core {

/// At its beginning, nothing cached.
struct RaysWorld {
  static constexpr uint kGroupSize = 64;

  /// num_slots: 0: one for each block.
  RaysWorld(ocl::Device &device, const test::TestVolume &test_volume, const Camera &camera,
            ImageSize size, float isovalue, std::uint32_t spec_count, uint num_slots = 0,
            uint group_size = kGroupSize)
      : volume(test_volume),
        frame(make_frame_params(volume.info(), camera, size, isovalue)),
        rays(device, {.num_rays = size.num_rays(), .with_pairs = false}),
        blocks(
            device, volume.compressed, DeviceStream(device, volume.compressed),
            BlockCache::limits_for(
                frame.grid, num_slots != 0 ? num_slots : static_cast<uint>(block_count(frame.grid)),
                size.num_rays()),
            group_size),
        start_rays(device, size.num_rays(), group_size),
        march(device, size.num_rays(), group_size, kDefaultSolver),
        request_ahead(device, size.num_rays(), group_size) {
    blocks.open(rays, {frame}, {{stream.layout, 0}}, FieldBound::kNone, RaySource::kCamera);
    rays.frame.schedule.max_spec_count = spec_count;
    frame = rays.frame;
    const std::vector<uint> masks = macrocells.masks().read();
    for (uint pixel = 0; pixel < size.num_rays(); ++pixel) {
      std::vector<uint> &list = active_blocks.emplace_back(blocks_of_ray(frame, pixel));
      std::erase_if(list, [&](uint block) { return !has_bit(masks, block); });
    }
  }

  glm::uvec3 coords(uint block) const {
    return {block % frame.grid.blocks_x, block / frame.grid.blocks_x % frame.grid.blocks_y,
            block / frame.grid.blocks_x / frame.grid.blocks_y};
  }

  /// A block's bit in masks laid out as those of the macrocells.
  bool has_bit(const std::vector<uint> &masks, uint block) const {
    const glm::uvec3 b = coords(block);
    const uint coarse_x = (frame.grid.blocks_x + 3) / 4, coarse_y = (frame.grid.blocks_y + 3) / 4;
    const uint bit = b.x % 4 + 4 * (b.y % 4) + 16 * (b.z % 4);
    return (masks[2 * (b.x / 4 + coarse_x * (b.y / 4 + coarse_y * (b.z / 4))) + bit / 32] >>
                bit % 32 &
            1u) != 0;
  }

  PassCounts counts() const { return rays.counts.read().front(); }

  /// The rays that go on, as they are listed.
  std::vector<RayEntry> entries() const {
    std::vector<uint> words(counts().next_active_count);
    rays.next_active_ray_ids.read(words);
    std::vector<RayEntry> entries;
    for (const uint word : words) entries.push_back(unpack_entry(word));
    return entries;
  }

  /// The rays that go on, and the block that each stands at.
  std::map<uint, uint> waiting() const {
    const std::vector<uint> stands = rays.ray_block_ids.read();
    const std::vector<RayEntry> listed = entries();
    std::map<uint, uint> waiting;
    for (const RayEntry &entry : listed) waiting.emplace(entry.pixel, stands[entry.pixel]);
    EXPECT_EQ(waiting.size(), listed.size()) << "a ray is listed twice";
    return waiting;
  }

  /// The rays that meet an active block, and the first that each meets.
  std::map<uint, uint> first_blocks() const {
    std::map<uint, uint> first;
    for (uint pixel = 0; pixel < active_blocks.size(); ++pixel) {
      if (!active_blocks[pixel].empty()) first.emplace(pixel, active_blocks[pixel].front());
    }
    return first;
  }

  /// Gives slots and values to the blocks that the pass before asked for.
  void provide() { blocks.provide(rays.previous_counts, {}, rays); }

  /// [blocks] slot of each block, ISO_BLOCK_ABSENT if it is not cached.
  std::vector<uint> slots_by_block() const {
    return test::slots_by_block(frame, cache.table.read());
  }

  const test::TestVolume &volume;
  FrameParams frame;
  Wavefront rays;
  BlockStore blocks;
  DeviceStream &stream = blocks.levels[0].stream;
  Macrocells &macrocells = blocks.levels[0].macrocells;
  BlockCache &cache = blocks.cache;
  StartRays start_rays;
  March march;
  RequestAhead request_ahead;
  std::vector<std::vector<uint>> active_blocks;  ///< by pixel, in ray order
};

}  // namespace isowave::core
