#pragma once
// What tests of stages that make triangles share: surfaces whose blocks are all listed and cached.

#include <cmath>
#include <vector>

#include "core/stages/active_blocks.hpp"
#include "core/stages/request_surface.hpp"
#include "tests/stage_world.hpp"

namespace isowave::core {

/// Few values, so that many voxels equal the isovalue, and every sign is there.
inline std::vector<float> coarse_noise(const glm::uvec3 &dims, uint seed) {
  std::vector<float> voxels = random_voxels(dims, -2.5f, 2.5f, seed);
  for (float &voxel : voxels) voxel = std::round(voxel);
  return voxels;
}

/// Masks of macrocells.cl as if all blocks were active that own cells.
inline std::vector<uint> all_active_masks(const FrameParams &frame) {
  const glm::uvec3 coarse =
      (glm::uvec3(frame.grid.blocks_x, frame.grid.blocks_y, frame.grid.blocks_z) + 3u) / 4u;
  std::vector<uint> masks(2 * std::size_t{coarse.x} * coarse.y * coarse.z);
  for (uint z = 0; z < num_owning_blocks(frame.grid.dims_z); ++z) {
    for (uint y = 0; y < num_owning_blocks(frame.grid.dims_y); ++y) {
      for (uint x = 0; x < num_owning_blocks(frame.grid.dims_x); ++x) {
        const uint cell = x / 4 + coarse.x * (y / 4 + coarse.y * (z / 4)),
                   bit = x % 4 + 4 * (y % 4) + 16 * (z % 4);
        masks[2 * std::size_t{cell} + bit / 32] |= 1u << bit % 32;
      }
    }
  }
  return masks;
}

/// All blocks of a volume, listed, with all that they need cached.
struct CachedSurface {
  CachedSurface(ocl::Device &device, const glm::uvec3 &dims, const std::vector<float> &voxels,
                float isovalue, Gradients gradients)
      : world(device, frame_of(dims, isovalue), std::max(num_blocks(dims), 8u), 8),
        masks(device, "masks", std::span<const uint>(all_active_masks(world.frame))),
        listed(device, num_macrocells(world.frame.grid)),
        num_listed(listed.count(world.frame, masks)),
        block_ids(device, "listed blocks", num_listed) {
    listed.list(world.frame, block_ids);
    RequestSurface request(device, gradients);
    world.begin_pass({}, 1);
    request(block_ids, 0, num_listed, world.cache, world.rays);
    world.assign_slots();
    world.fill_slots(voxels);  // NaN in padding, which no vertex may see
    world.cache.classify(world.rays);
  }

  StageWorld world;
  ocl::Buffer<uint> masks;
  ActiveBlocks listed;
  uint num_listed;
  ocl::Buffer<uint> block_ids;

 private:
  static FrameParams frame_of(const glm::uvec3 &dims, float isovalue) {
    FrameParams frame = plain_frame(dims, 64);
    frame.surface.isovalue = isovalue;
    return frame;
  }
  static uint num_blocks(const glm::uvec3 &dims) {
    return static_cast<uint>(block_count(grid_frame(dims).grid));
  }
};

}  // namespace isowave::core
