/// found_slots.h -- the cached ones of 2^3 blocks, and the voxels in them. OpenCL C 1.2.
#ifndef ISOWAVE_FOUND_SLOTS_H
#define ISOWAVE_FOUND_SLOTS_H

#include "portable/block_table.h"
#include "slot_values.h"
#include "work_group.h"

/// Looks for those of the 2^3 blocks from `base` on whose bits (corner x + 2y + 4z) are set in
/// `wanted`. Returns which of them are cached, and their places in slots [8], ISO_SCRATCH_STRIDE
/// apart. In steps for all of them, as find_dual_grid().
ISO_LONG uint find_slots(const FrameParams *frame, global const uint *table, BlockCoords base,
                         uint wanted, ISO_SCRATCH uint *slots) {
  const uint none = empty_page(frame->schedule.cache_slots);
  uint pages[8], have = 0;
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    pages[corner] = (wanted >> corner & 1u) != 0
                        ? table[directory_word(frame, base.x + (corner & 1),
                                               base.y + (corner >> 1 & 1), base.z + (corner >> 2))]
                        : none;
  }
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    const uint slot = table[page_word(frame, pages[corner], base.x + (corner & 1),
                                      base.y + (corner >> 1 & 1), base.z + (corner >> 2))];
    slots[corner * ISO_SCRATCH_STRIDE] = slot;
    have |= (uint)(slot != ISO_BLOCK_ABSENT) << corner;
  }
  return have;
}

/// The voxels of a stencil in the cache: in slots [8] of the blocks from `base` on,
/// ISO_SCRATCH_STRIDE apart.
typedef struct CachedStencil {
  global const SlotValue *values;
  ISO_SCRATCH const uint *slots;
  BlockCoords base;
  uint group;  ///< whose field the voxels are of; only read if ISO_LABELS is 1
} CachedStencil;

ISO_INLINE float stencil_voxel(const CachedStencil *cached, int x, int y, int z) {
  const uint vx = (uint)x - 4 * cached->base.x, vy = (uint)y - 4 * cached->base.y,
             vz = (uint)z - 4 * cached->base.z;
  const uint slot = cached->slots[((vx >> 2) + 2 * (vy >> 2) + 4 * (vz >> 2)) * ISO_SCRATCH_STRIDE];
  const float value =
      cached->values[slot * ISO_BLOCK_VOXELS + (vx & 3) + 4 * (vy & 3) + 16 * (vz & 3)];
  return ISO_LABELS ? group_field((uint)value, cached->group) : value;
}

#endif
