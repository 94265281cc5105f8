/// block_walk.h -- a ray's way through the blocks that the isovalue is in the range of (Sec. 3.3).
/// OpenCL C 1.2. Two-level grid: a coarse macrocell is 4^3 blocks; its 64 bits say which of them
/// are active (macrocells.cl). A coarse cell with no bit is left in one step.
///
/// ISO_FOUND is the address space of the list. Define it before including this, unless it is that
/// of scratch.
#ifndef ISOWAVE_BLOCK_WALK_H
#define ISOWAVE_BLOCK_WALK_H

#include "level_band.h"
#include "portable/block_grid.h"
#include "portable/grid_dda.h"

#ifndef ISO_FOUND
#define ISO_FOUND ISO_SCRATCH
#endif

/// Blocks that a ray finds before it intersects them, or asks for them. On a GPU, a longer list is
/// walked by more work-items: a last ray has up to one for each block. A CPU would look for more
/// blocks than it needs.
#ifdef ISO_CPU
#define ISO_BLOCKS_AT_ONCE 8u
#else
#define ISO_BLOCKS_AT_ONCE 16u
#endif

ISO_INLINE int is_active(const FrameParams *frame, global const uint *macrocell_masks,
                         BlockCoords b) {
  const uint coarse_x = (frame->grid.blocks_x + 3) / 4, coarse_y = (frame->grid.blocks_y + 3) / 4;
  const uint cell = b.x / 4 + coarse_x * (b.y / 4 + coarse_y * (b.z / 4));
  const uint bit = (b.x & 3) + 4 * (b.y & 3) + 16 * (b.z & 3);
  return (macrocell_masks[masks_begin(frame) + 2 * cell + bit / 32] >> (bit % 32) & 1u) != 0;
}

/// The block of coarse macrocell (cx,cy,cz) that the ray is in just after event `e`, by which it
/// entered the cell.
ISO_INLINE GridWalk enter_macrocell(const Ray *ray, const GridWalk *coarse, RayEvent e,
                                    LastPlanes last) {
  const int bx = coarse->x * ISO_MACROCELL_BLOCKS, by = coarse->y * ISO_MACROCELL_BLOCKS,
            bz = coarse->z * ISO_MACROCELL_BLOCKS;
  const int x = locate(ray->x, 0, e, 4, bx, min(bx + ISO_MACROCELL_BLOCKS - 1, (last.x - 1) / 4));
  const int y = locate(ray->y, 1, e, 4, by, min(by + ISO_MACROCELL_BLOCKS - 1, (last.y - 1) / 4));
  const int z = locate(ray->z, 2, e, 4, bz, min(bz + ISO_MACROCELL_BLOCKS - 1, (last.z - 1) / 4));
  return walk_from(ray, x, y, z, 4, last);
}

/// Walks on from block *block_id, within the box of active blocks, to the next `wanted` active
/// blocks, into found [wanted], `stride` apart. Returns how many there are before the ray has left
/// the box, or its interval; *block_id becomes the first block not looked at, or ISO_INVALID_ID.
ISO_LONG uint find_blocks(const FrameParams *frame, global const uint *macrocell_masks,
                          const Ray *ray, uint *block_id, uint wanted, ISO_FOUND uint *found,
                          uint stride) {
  const LastPlanes last = last_planes(frame);
  const uint coarse_x = (frame->grid.blocks_x + 3) / 4, coarse_y = (frame->grid.blocks_y + 3) / 4;
  const uint begin = masks_begin(frame);
  /* The coarse cells behind the box, in the ray's direction. */
  const int behind_x = ray->x.d > 0.0f ? (frame->surface.active_end_x + 3) / 4
                                       : frame->surface.active_begin_x / 4 - 1,
            behind_y = ray->y.d > 0.0f ? (frame->surface.active_end_y + 3) / 4
                                       : frame->surface.active_begin_y / 4 - 1,
            behind_z = ray->z.d > 0.0f ? (frame->surface.active_end_z + 3) / 4
                                       : frame->surface.active_begin_z / 4 - 1;
  const BlockCoords from = block_coords(frame, *block_id);
  /* The outer walk steps from coarse cell to coarse cell; only in those with a bit is there an
   * inner one. */
  GridWalk w = walk_from(ray, (int)from.x, (int)from.y, (int)from.z, 4, last);
  GridWalk coarse = walk_from(ray, w.x / ISO_MACROCELL_BLOCKS, w.y / ISO_MACROCELL_BLOCKS,
                              w.z / ISO_MACROCELL_BLOCKS, 4 * ISO_MACROCELL_BLOCKS, last);
  RayEvent exit = start_event(); /* of the block or cell that the ray was in last */
  int within = 1, follows = 1;   /* follows: w is in this coarse cell */
  uint k = 0;
  while (within && k < wanted) {
    const uint cell = (uint)coarse.x + coarse_x * ((uint)coarse.y + coarse_y * (uint)coarse.z);
    const uint low = macrocell_masks[begin + 2 * cell],
               high = macrocell_masks[begin + 2 * cell + 1];
    int left = 0;
    if ((low | high) != 0) {
      if (!follows) w = enter_macrocell(ray, &coarse, exit, last);
      while (!left && k < wanted) {
        const uint bit = (uint)((w.x & 3) + 4 * (w.y & 3) + 16 * (w.z & 3));
        if ((bit < 32 ? low >> bit : high >> (bit - 32)) & 1u) {
          found[stride * k++] = block_id_at(frame, (uint)w.x, (uint)w.y, (uint)w.z);
        }
        exit = walk_exit(&w, ray);
        left = leaves(&w, &coarse, exit) || ends_ray(ray, exit);
        walk_step(&w, ray, exit, 4, last);
      }
    } else {
      exit = walk_exit(&coarse, ray);
      left = 1;
    }
    follows = (low | high) != 0;
    if (left && ends_ray(ray, exit)) {
      within = 0;
    } else if (left) {
      walk_step(&coarse, ray, exit, 4 * ISO_MACROCELL_BLOCKS, last);
      within = coarse.x != behind_x && coarse.y != behind_y && coarse.z != behind_z;
    }
  }
  *block_id = within ? block_id_at(frame, (uint)w.x, (uint)w.y, (uint)w.z) : ISO_INVALID_ID;
  return k;
}

/// The block in which a ray enters the box of active blocks, or begins in it;
/// ISO_INVALID_ID if it does not meet the box.
ISO_INLINE uint first_block(const FrameParams *frame, const Ray *ray) {
  const LastPlanes last = last_planes(frame);
  LastPlanes begin, end;
  RayEvent enter = ray_begin(ray), exit = ray_end(ray);
  begin.x = 4 * frame->surface.active_begin_x;
  begin.y = 4 * frame->surface.active_begin_y;
  begin.z = 4 * frame->surface.active_begin_z;
  end.x = min(4 * frame->surface.active_end_x, last.x);
  end.y = min(4 * frame->surface.active_end_y, last.y);
  end.z = min(4 * frame->surface.active_end_z, last.z);
  if (begin.x >= end.x || !clip_to_box(ray, begin, end, &enter, &exit)) return ISO_INVALID_ID;
  return block_id_at(
      frame, (uint)locate(ray->x, 0, enter, 4, frame->surface.active_begin_x, (end.x - 1) / 4),
      (uint)locate(ray->y, 1, enter, 4, frame->surface.active_begin_y, (end.y - 1) / 4),
      (uint)locate(ray->z, 2, enter, 4, frame->surface.active_begin_z, (end.z - 1) / 4));
}

/// Is block (x,y,z) in the box of active blocks?
ISO_INLINE int is_in_box(const FrameParams *frame, int x, int y, int z) {
  return x >= frame->surface.active_begin_x && x < frame->surface.active_end_x &&
         y >= frame->surface.active_begin_y && y < frame->surface.active_end_y &&
         z >= frame->surface.active_begin_z && z < frame->surface.active_end_z;
}

/// The block behind block b on the ray, or ISO_INVALID_ID behind all active ones, or the ray's
/// interval.
ISO_INLINE uint block_behind(const FrameParams *frame, const Ray *ray, BlockCoords b,
                             LastPlanes last) {
  GridWalk w = walk_from(ray, (int)b.x, (int)b.y, (int)b.z, 4, last);
  const RayEvent exit = walk_exit(&w, ray);
  walk_step(&w, ray, exit, 4, last);
  return !ends_ray(ray, exit) && is_in_box(frame, w.x, w.y, w.z)
             ? block_id_at(frame, (uint)w.x, (uint)w.y, (uint)w.z)
             : ISO_INVALID_ID;
}

#endif
