/// block_walk.h -- a ray's walk over the blocks that the isovalue is in the range of (Sec. 3.3). OpenCL C 1.2.
/// Two-level grid: a coarse macrocell is 4^3 blocks; its 64 bits say which of them are active (macrocells.cl). A coarse
/// cell with no bit is left in one step.
#ifndef ISOWAVE_BLOCK_WALK_H
#define ISOWAVE_BLOCK_WALK_H

#include "block_grid.h"
#include "grid_dda.h"

typedef struct BlockWalk {
  GridWalk block;   ///< the block the ray is in; of no meaning in a coarse cell without a bit
  GridWalk coarse;  ///< its coarse cell
  uint low, high;   ///< that cell's bits
} BlockWalk;

inline void load_coarse_bits(constant FrameParams *frame, global const uint *macrocell_masks,
                             BlockWalk *walk) {
  const uint coarse_x = (frame->blocks_x + 3) / 4, coarse_y = (frame->blocks_y + 3) / 4;
  const uint cell =
      (uint)walk->coarse.x + coarse_x * ((uint)walk->coarse.y + coarse_y * (uint)walk->coarse.z);
  walk->low = macrocell_masks[2 * cell];
  walk->high = macrocell_masks[2 * cell + 1];
}

/// A walk that stands in block (x,y,z).
inline BlockWalk block_walk_from(constant FrameParams *frame, global const uint *macrocell_masks,
                                 const Ray *ray, int x, int y, int z, LastPlanes last) {
  BlockWalk walk;
  walk.block = walk_from(ray, x, y, z, 4, last);
  walk.coarse = walk_from(ray, x / ISO_MACROCELL_BLOCKS, y / ISO_MACROCELL_BLOCKS, z / ISO_MACROCELL_BLOCKS,
                          4 * ISO_MACROCELL_BLOCKS, last);
  load_coarse_bits(frame, macrocell_masks, &walk);
  return walk;
}

/// The block of the walk's coarse cell that the ray is in just after event `e`, by which it entered that cell.
inline GridWalk enter_macrocell(const Ray *ray, const GridWalk *coarse, RayEvent e, LastPlanes last) {
  const int bx = coarse->x * ISO_MACROCELL_BLOCKS, by = coarse->y * ISO_MACROCELL_BLOCKS,
            bz = coarse->z * ISO_MACROCELL_BLOCKS;
  const int x = locate(ray->x, 0, e, 4, bx, min(bx + ISO_MACROCELL_BLOCKS - 1, (last.x - 1) / 4));
  const int y = locate(ray->y, 1, e, 4, by, min(by + ISO_MACROCELL_BLOCKS - 1, (last.y - 1) / 4));
  const int z = locate(ray->z, 2, e, 4, bz, min(bz + ISO_MACROCELL_BLOCKS - 1, (last.z - 1) / 4));
  return walk_from(ray, x, y, z, 4, last);
}

/// Goes on to the first active block, which may be the one that the walk stands in. Returns 0 when the ray has left the
/// volume.
inline int find_active_block(constant FrameParams *frame, global const uint *macrocell_masks, const Ray *ray,
                             LastPlanes last, BlockWalk *walk) {
  for (;;) {
    RayEvent entry;
    if ((walk->low | walk->high) != 0) {
      while (walk->block.x >> 2 == walk->coarse.x && walk->block.y >> 2 == walk->coarse.y &&
             walk->block.z >> 2 == walk->coarse.z) {
        const uint bit = (uint)((walk->block.x & 3) + 4 * (walk->block.y & 3) + 16 * (walk->block.z & 3));
        if (4 * walk->block.x >= last.x || 4 * walk->block.y >= last.y || 4 * walk->block.z >= last.z)
          return 0;
        if ((bit < 32 ? walk->low >> bit : walk->high >> (bit - 32)) & 1u) return 1;
        walk_step(&walk->block, ray, walk_exit(&walk->block), 4, last);
      }
    }
    entry = walk_exit(&walk->coarse);
    walk_step(&walk->coarse, ray, entry, 4 * ISO_MACROCELL_BLOCKS, last);
    if (walk->coarse.x < 0 || 16 * walk->coarse.x >= last.x || walk->coarse.y < 0 ||
        16 * walk->coarse.y >= last.y || walk->coarse.z < 0 || 16 * walk->coarse.z >= last.z) {
      return 0;
    }
    load_coarse_bits(frame, macrocell_masks, walk);
    if ((walk->low | walk->high) != 0) walk->block = enter_macrocell(ray, &walk->coarse, entry, last);
  }
}

inline uint walk_block_id(constant FrameParams *frame, const BlockWalk *walk) {
  return block_id_at(frame, (uint)walk->block.x, (uint)walk->block.y, (uint)walk->block.z);
}

/// Leaves the block that the walk stands in. Returns 0 when that leaves the volume.
inline int leave_block(const Ray *ray, LastPlanes last, BlockWalk *walk) {
  walk_step(&walk->block, ray, walk_exit(&walk->block), 4, last);
  return walk->block.x >= 0 && 4 * walk->block.x < last.x && walk->block.y >= 0 &&
         4 * walk->block.y < last.y && walk->block.z >= 0 && 4 * walk->block.z < last.z;
}

#endif
