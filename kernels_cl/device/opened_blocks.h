/// opened_blocks.h -- the blocks that a work-item's rays have come to in this pass: their changing
/// cells, and the voxels of their dual grids side by side, so that a cell's corners are four pairs
/// (march_packets.cl). OpenCL C 1.2.
///
/// A table has a place for each position in a group of 4^3 blocks; a block that comes later takes
/// the place of another at the same position. No block leaves the cache meanwhile, so a ray
/// whose block has lost its place may look the block up again.
#ifndef ISOWAVE_OPENED_BLOCKS_H
#define ISOWAVE_OPENED_BLOCKS_H

#include "float8.h"
#include "march_block.h"

#define ISO_OPENED_BLOCKS 64u
/// 5^3, and some more, so that all of an OpenedBlock are 132 words.
#define ISO_BRICK_VOXELS 128
#define ISO_OPENED_WORDS (ISO_BRICK_VOXELS + 4)
/// In OpenedBlock::have: the block itself is cached, and its cells are known.
#define ISO_OPENED_CACHED 0x100u

typedef struct OpenedBlock {
  uint block_id;  ///< ISO_INVALID_ID: none so far
  uint have;      ///< bits 0..7: corners of the dual grid whose voxels are here, or that no cell
                  ///< reaches; ISO_OPENED_CACHED
  uint cells_low, cells_high;
  float voxels[ISO_BRICK_VOXELS];  ///< x + 5y + 25z
} OpenedBlock;

ISO_INLINE uint opened_place(BlockCoords b) {
  return (b.x & 3) + 4 * (b.y & 3) + 16 * (b.z & 3);
}

/// Four values of the field, side by side in a slot.
ISO_INLINE float4 field_of_row(const FrameParams *frame, uint row, global const SlotValue *values) {
  return ISO_LABELS ? convert_float4(
                          convert_uint4(vload4(row, values)) >> frame->surface.isovalue_index & 1u)
                    : convert_float4(vload4(row, values));
}

/// Copies the voxels of a corner of the dual grid to their places in it.
ISO_INLINE void copy_corner(const FrameParams *frame, global const SlotValue *values, uint corner,
                            float *voxels) {
  const uint rows = (corner & 2u) != 0 ? 1 : 4, layers = (corner & 4u) != 0 ? 1 : 4;
  float *to = voxels + ((corner & 1u) != 0 ? 4 : 0) + ((corner & 2u) != 0 ? 20 : 0) +
              ((corner & 4u) != 0 ? 100 : 0);
  for (uint z = 0; z < layers; ++z) {
    for (uint y = 0; y < rows; ++y) {
      if ((corner & 1u) != 0)
        to[5 * y + 25 * z] = field_of_slot(frame, values[4 * y + 16 * z]);
      else
        vstore4(field_of_row(frame, y + 4 * z, values), 0, to + 5 * y + 25 * z);
    }
  }
}

/// Opens block b with what is cached of its dual grid.
ISO_SELDOM void open_with_voxels(const CacheReader *cache, const FrameParams *frame, BlockCoords b,
                                 OpenedBlock *opened) {
  uint have;
  const ulong cells = open_block(frame, cache, b, &have);
  opened->block_id = block_id_at(frame, b.x, b.y, b.z);
  opened->have = have;
  opened->cells_low = (uint)cells;
  opened->cells_high = (uint)(cells >> 32);
  if ((have & 1u) == 0) return;
  opened->have |= ISO_OPENED_CACHED;
  stamp_block(cache);
  _Pragma("unroll") for (uint corner = 0; corner < 8; ++corner) {
    const uint slot = cache->slots[corner * ISO_SCRATCH_STRIDE];
    if (slot != ISO_BLOCK_ABSENT)
      copy_corner(frame, cache->values + slot * ISO_BLOCK_VOXELS, corner, opened->voxels);
  }
}

/// Opens block b if its cells are known, or if it is not cached; without voxels, since rays
/// pass by the cells of every third block. Else returns 0.
ISO_INLINE int open_without_voxels(const CacheReader *cache, const FrameParams *frame,
                                   BlockCoords b, OpenedBlock *opened) {
  const uint slot = slot_by_now(frame, cache->table, b);
  opened->have = 0;
  if (slot != ISO_BLOCK_ABSENT) {
    const ulong cells = cache->changing[slot];
    opened->cells_low = (uint)cells;
    opened->cells_high = (uint)(cells >> 32);
    if ((opened->cells_low & opened->cells_high) == (uint)ISO_CHANGING_UNKNOWN) return 0;
    opened->have = ISO_OPENED_CACHED;
    cache->slot_stamps[slot] = cache->stamp;
  }
  opened->block_id = block_id_at(frame, b.x, b.y, b.z);
  return 1;
}

/// The corners of the cell whose least one is at `least`, corner x + 2y + 4z.
ISO_INLINE float8 cell_corners(const float *least) {
  const float2 a = vload2(0, least), b = vload2(0, least + 5), c = vload2(0, least + 25),
               d = vload2(0, least + 30);
  return (float8)(a.x, a.y, b.x, b.y, c.x, c.y, d.x, d.y); /* see transpose() */
}

/// The corners of the dual grid (bits 0..7) that have the voxels of local cells: cell_blocks().
ISO_INLINE Ints blocks_of_cells(Ints x, Ints y, Ints z) {
  const Ints of_borders = pick(z == 3, ints((int)0xFF553311), ints(0x0F050301));
  return of_borders >> (((x == 3) & 8) | ((y == 3) & 16)) & 0xFF;
}

#endif
