/// dual_grid_inside.h -- which voxels of a cached dual grid are inside. OpenCL C 1.2.
#ifndef ISOWAVE_DUAL_GRID_INSIDE_H
#define ISOWAVE_DUAL_GRID_INSIDE_H

#include "portable/block_table.h"

/// Of the dual grid of block b: which voxels of its blocks are inside, corner x + 2y + 4z; 0 of
/// those that there are not.
ISO_INLINE void dual_grid_inside(const FrameParams *frame, global const BlockEntry *table,
                                 global const ulong *inside, BlockCoords b, ulong *bits) {
  for (uint corner = 0; corner < 8; ++corner) {
    uint slot = ISO_BLOCK_ABSENT;
    if (dual_grid_block(frame, b, corner) != ISO_INVALID_ID)
      slot = cached_slot(frame, table, b.x + (corner & 1), b.y + (corner >> 1 & 1),
                         b.z + (corner >> 2));
    bits[corner] = slot == ISO_BLOCK_ABSENT ? 0 : inside[slot];
  }
}

#endif
