#pragma once
// One volume and one wavefront on a device, for tests that run a few stages of a pass by hand.

#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

#include "core/paper/scan.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/wavefront.hpp"
#include "core/view/frame.hpp"
#include "kernels_cl/portable/block_grid.h"
#include "tests/cache_table.hpp"
#include "tests/slot_values.hpp"
#include "tests/stage_support.hpp"

namespace isowave::core {

/// The blocks of a dual grid, by plain arithmetic.
inline std::vector<uint> dual_grid_blocks(const FrameParams &frame, uint block_id) {
  const uint x = block_id % frame.grid.blocks_x,
             y = block_id / frame.grid.blocks_x % frame.grid.blocks_y,
             z = block_id / frame.grid.blocks_x / frame.grid.blocks_y;
  std::vector<uint> blocks;
  for (uint dz = 0; dz < 2; ++dz) {
    for (uint dy = 0; dy < 2; ++dy) {
      for (uint dx = 0; dx < 2; ++dx) {
        if (x + dx < frame.grid.blocks_x && y + dy < frame.grid.blocks_y &&
            z + dz < frame.grid.blocks_z)
          blocks.push_back(x + dx +
                           frame.grid.blocks_x * (y + dy + frame.grid.blocks_y * (z + dz)));
      }
    }
  }
  return blocks;
}

/// A wavefront whose first pass begins with every pixel active, and a cache.
struct StageWorld {
  StageWorld(ocl::Device &device, const FrameParams &frame_params, uint num_slots, uint group_size)
      : frame(frame_params),
        rays(device, {frame.view.width * frame.view.height}),
        cache(device, BlockCache::limits_for(frame.grid, num_slots, rays.num_rays), group_size),
        compaction(device, rays.num_rays, group_size) {
    set_frame(frame_params);
    std::vector<uint> ids(rays.num_rays);
    for (uint i = 0; i < ids.size(); ++i) ids[i] = i;
    set_active(ids);
  }

  /// Another camera or isovalue; image size and volume stay.
  void set_frame(const FrameParams &frame_params) {
    frame = frame_params;
    frame.schedule.cache_slots = cache.num_slots;
    rays.frame = frame;
  }

  PassCounts counts() const { return rays.counts.read().front(); }

  void set_active(const std::vector<uint> &ray_ids) {
    active_ray_ids = ray_ids;
    rays.active_ray_ids.write(ray_ids);
  }

  /// The next pass is the first of a frame.
  void begin_frame() { frame_begins_ = true; }

  /// Opens a pass by hand: these pairs, entries a * spec_count + k for active ray a.
  void begin_pass(const std::vector<uint> &pair_block_ids, uint spec_count) {
    PassCounts counts = rays.counts.read().front();
    const PassCounts last = counts;
    const bool begins = std::exchange(frame_begins_, false);
    counts = {};
    counts.ray_count = static_cast<uint>(rays.num_rays);
    counts.pass = last.pass + 1;
    counts.frame_pass = begins ? counts.pass : last.frame_pass;
    counts.last_frame_pass = begins ? last.frame_pass : last.last_frame_pass;
    counts.active_count = static_cast<uint>(pair_block_ids.size()) / spec_count;
    counts.window_count = counts.active_count;
    counts.spec_count = spec_count;
    counts.pair_slot_count = static_cast<uint>(pair_block_ids.size());
    rays.counts.write({&counts, 1});
    rays.pair_block_ids.write(pair_block_ids);
    rays.closest_pairs.fill(ISO_INVALID_ID);
  }

  /// Slots for the blocks requested in this pass.
  void assign_slots() {
    cache.evict(rays.counts, rays);
    cache.assign(rays.counts, rays);
  }

  /// [blocks] slot of each block, ISO_BLOCK_ABSENT if it is not cached.
  std::vector<uint> slots_by_block() const {
    return test::slots_by_block(frame, cache.table.read());
  }

  /// Instead of decoding: puts the voxels [nz][ny][nx] of the blocks just granted into their slots,
  /// and NaN into padding, which no kernel may use.
  void fill_slots(const std::vector<float> &voxels) {
    const uint granted = counts().decoded_count;
    const std::vector<uint> blocks = cache.request_block_ids.read(),
                            slots = cache.decode_slots.read();
    std::vector<float> values = test::slot_values(cache.values);
    for (uint i = 0; i < granted; ++i) {
      const uint x0 = 4 * (blocks[i] % frame.grid.blocks_x),
                 y0 = 4 * (blocks[i] / frame.grid.blocks_x % frame.grid.blocks_y),
                 z0 = 4 * (blocks[i] / frame.grid.blocks_x / frame.grid.blocks_y);
      for (uint v = 0; v < 64; ++v) {
        const uint x = x0 + v % 4, y = y0 + v / 4 % 4, z = z0 + v / 16;
        const bool in_domain =
            x < frame.grid.dims_x && y < frame.grid.dims_y && z < frame.grid.dims_z;
        values[64 * std::size_t{slots[i]} + v] =
            in_domain ? voxels[x + frame.grid.dims_x * (y + std::size_t{frame.grid.dims_y} * z)]
                      : std::numeric_limits<float>::quiet_NaN();
      }
    }
    cache.values.write(test::float_slots(values));  // whole: see kernels_cl/README.md, Oclgrind
  }

  FrameParams frame;
  Wavefront rays;
  BlockCache cache;
  Compaction compaction;
  std::vector<uint> active_ray_ids;

 private:
  bool frame_begins_ = false;
};

/// A camera-less frame: only grid and number of pixels matter.
inline FrameParams plain_frame(const glm::uvec3 &dims, uint width, uint height = 1) {
  FrameParams frame = grid_frame(dims);
  frame.view.width = width;
  frame.view.height = height;
  frame.schedule.max_spec_count = ISO_MAX_SPECULATION;
  return frame;
}

/// Corners of dual cell (x,y,z), corner x + 2y + 4z, minus the isovalue.
inline std::array<float, 8> cell_corners(const FrameParams &frame, const std::vector<float> &voxels,
                                         int x, int y, int z) {
  std::array<float, 8> w;
  for (int corner = 0; corner < 8; ++corner) {
    const auto vx = static_cast<std::size_t>(x + (corner & 1)),
               vy = static_cast<std::size_t>(y + (corner >> 1 & 1)),
               vz = static_cast<std::size_t>(z + (corner >> 2));
    w[static_cast<std::size_t>(corner)] =
        voxels[vx + frame.grid.dims_x * (vy + frame.grid.dims_y * vz)] - frame.surface.isovalue;
  }
  return w;
}

}  // namespace isowave::core
