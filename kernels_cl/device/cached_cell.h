/// cached_cell.h -- voxels straight from the cache, for kernels that need few of them. OpenCL
/// C 1.2.
#ifndef ISOWAVE_CACHED_CELL_H
#define ISOWAVE_CACHED_CELL_H

#include "portable/block_table.h"
#include "slot_values.h"

/// The corners of dual cell (x,y,z) from the cache, minus the isovalue; corner x + 2y + 4z. All its
/// blocks are cached.
ISO_INLINE void load_corners(const FrameParams *frame, global const uint *table,
                             global const SlotValue *cache_values, int x, int y, int z, float *w) {
  for (int corner = 0; corner < 8; ++corner) {
    const uint vx = (uint)(x + (corner & 1)), vy = (uint)(y + (corner >> 1 & 1)),
               vz = (uint)(z + (corner >> 2));
    const uint slot = cached_slot(frame, table, vx >> 2, vy >> 2, vz >> 2);
    w[corner] =
        field_of_slot(
            frame,
            cache_values[slot * ISO_BLOCK_VOXELS + (vx & 3) + 4 * (vy & 3) + 16 * (vz & 3)]) -
        frame->surface.isovalue;
  }
}

#endif
