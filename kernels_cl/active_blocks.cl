/// active_blocks.cl -- the blocks that an isosurface is extracted from, as a list.
///
///   active_masks -> prefix sum of the macrocells' counts -> active_list
///
/// Listed are the active blocks of macrocells.cl, and those beside them that own no cell, since
/// just one layer of voxels is left for them at the domain's end: edges of an active block's cells
/// begin there. The list has them by coarse macrocell, then by place in it, so neighbours on the
/// list are neighbours in space; and the place of a block on it is a macrocell's offset and a count
/// of bits.
#include "portable/block_grid.h"

/// The bit x + 4y + 16z of block b in `masks` [2 * coarse macrocells].
ISO_INLINE uint mask_bit(const FrameParams *frame, global const uint *masks, uint x, uint y,
                         uint z) {
  const uint coarse_x = (frame->grid.blocks_x + 3) / 4, coarse_y = (frame->grid.blocks_y + 3) / 4;
  const uint coarse = x / 4 + coarse_x * (y / 4 + coarse_y * (z / 4));
  return masks[2 * coarse + (z >> 1 & 1)] >> ((x & 3) + 4 * (y & 3) + 16 * (z & 1)) & 1u;
}

/// 1 if a block is the last along an axis and has one layer of voxels, else 0.
ISO_INLINE uint is_one_layer(uint block, uint dim) {
  return 4 * block + 1 == dim;
}

/// active_masks [2 * coarse]  of macrocells.cl, of a volume's only level
/// Out     listed_masks [2 * coarse]: a bit for each block that is listed; counts [coarse]: the
///         number of bits of a macrocell
/// Launch  grid-stride over coarse macrocells
kernel void active_masks(const FrameParams frame_params, uint num_coarse,
                         global const uint *active_masks, global uint *listed_masks,
                         global uint *counts) {
  const FrameParams *frame = &frame_params;
  const BlockGrid grid = frame_params.grid;
  const uint coarse_x = (grid.blocks_x + 3) / 4, coarse_y = (grid.blocks_y + 3) / 4;
  for (uint coarse = get_global_id(0); coarse < num_coarse; coarse += get_global_size(0)) {
    uint words[2] = {active_masks[2 * coarse], active_masks[2 * coarse + 1]};
    const uint x = 4 * (coarse % coarse_x), y = 4 * (coarse / coarse_x % coarse_y),
               z = 4 * (coarse / coarse_x / coarse_y);
    const int at_end = (grid.dims_x % 4 == 1 && x + 4 >= grid.blocks_x) ||
                       (grid.dims_y % 4 == 1 && y + 4 >= grid.blocks_y) ||
                       (grid.dims_z % 4 == 1 && z + 4 >= grid.blocks_z);
    for (uint bit = 0; at_end && bit < 64; ++bit) {
      const uint bx = x + (bit & 3), by = y + (bit >> 2 & 3), bz = z + (bit >> 4);
      if (bx >= grid.blocks_x || by >= grid.blocks_y || bz >= grid.blocks_z) continue;
      const uint one_x = is_one_layer(bx, grid.dims_x), one_y = is_one_layer(by, grid.dims_y),
                 one_z = is_one_layer(bz, grid.dims_z);
      /* Its edges belong to cells of the block before it along these axes. */
      if ((one_x | one_y | one_z) != 0 &&
          mask_bit(frame, active_masks, bx - one_x, by - one_y, bz - one_z) != 0)
        words[bit >> 5] |= 1u << (bit & 31);
    }
    listed_masks[2 * coarse] = words[0];
    listed_masks[2 * coarse + 1] = words[1];
    counts[coarse] = popcount(words[0]) + popcount(words[1]);
  }
}

/// offsets [coarse]  prefix sums of the counts
/// Out     block_ids [all counts]
/// Launch  grid-stride over coarse macrocells
kernel void active_list(const FrameParams frame_params, uint num_coarse,
                        global const uint *listed_masks, global const uint *offsets,
                        global uint *block_ids) {
  const FrameParams *frame = &frame_params;
  const uint coarse_x = (frame->grid.blocks_x + 3) / 4, coarse_y = (frame->grid.blocks_y + 3) / 4;
  for (uint coarse = get_global_id(0); coarse < num_coarse; coarse += get_global_size(0)) {
    const uint x = 4 * (coarse % coarse_x), y = 4 * (coarse / coarse_x % coarse_y),
               z = 4 * (coarse / coarse_x / coarse_y);
    uint place = offsets[coarse];
    for (uint bit = 0; bit < 64; ++bit) {
      if ((listed_masks[2 * coarse + (bit >> 5)] >> (bit & 31) & 1u) != 0)
        block_ids[place++] = block_id_at(frame, x + (bit & 3), y + (bit >> 2 & 3), z + (bit >> 4));
    }
  }
}
