/// macrocells.cl -- value ranges of blocks and coarse macrocells, and what an isovalue touches
/// (Sec. 3.1).
///
/// A block's range is that of its dual cells: its own decoded voxels and the first layers of its
/// +x/+y/+z neighbours. Every block is decoded once: macrocell_partials keeps the ranges of the
/// eight sub-lattices that a block gives to itself and to its seven -x/-y/-z neighbours, one layer
/// of blocks (in z) at a time; macrocell_ranges joins them.
///
/// Ranges are stored in 8 bits through `thresholds` [256], ascending from -INFINITY to INFINITY:
/// low = the last threshold <= min, high = the first >= max. So they only ever grow: no block is
/// skipped wrongly. With `below` the first threshold >= isovalue + e and `above` the first >=
/// isovalue - f, if the frame's voxels may be lower by e and higher by f than those that ranges
/// were made of, some value may be below the isovalue iff low < below, and some at or above iff
/// high >= above. Both: active. e and f may be larger for blocks of larger bounds (block_bound.h).
/// Coarse macrocells of 4^3 blocks hold the union of their blocks.
///
/// With ISO_LABELS a voxel's value is a bit mask of groups (portable/label_table.h). Then low is
/// the groups that all voxels are in, high those that any voxel is in, and limits[0] is a group: a
/// block is active if the group is in high alone.
#include "device/block_stream.h"
#include "portable/block_grid.h"

ISO_INLINE VoxelRange no_range(void) {
  VoxelRange r;
  r.min = ISO_LABELS ? 255.0f : INFINITY;
  r.max = ISO_LABELS ? 0.0f : -INFINITY;
  return r;
}

ISO_INLINE VoxelRange join(VoxelRange a, VoxelRange b) {
  VoxelRange r;
#if ISO_LABELS
  r.min = (float)((uint)a.min & (uint)b.min);
  r.max = (float)((uint)a.max | (uint)b.max);
  return r;
#endif
  r.min = a.min < b.min ? a.min : b.min;
  r.max = a.max > b.max ? a.max : b.max;
  return r;
}

/// Decodes blocks, of which block i is sampled_block(first_block + i * stride, stride).
///
/// part_0 .. layout  the zfp stream, see block_stream.h
/// Out               partials [(first_partial + num_blocks) * 8]: entry 8 (first_partial + i) + m
///                   is the range of block i's voxels with x = 0 if m & 1, y = 0 if m & 2, z = 0 if
///                   m & 4; padding left out
/// Launch            grid-stride over blocks
kernel void macrocell_partials(const FrameParams frame_params, global const uint *part_0,
                               global const uint *part_1, global const uint *part_2,
                               global const uint *part_3, global const uint *index,
                               const StreamLayout layout, uint first_block, uint stride,
                               uint num_blocks, uint first_partial, global VoxelRange *partials) {
  const FrameParams *frame = &frame_params;
  for (uint i = get_global_id(0); i < num_blocks; i += get_global_size(0)) {
    const uint block_id = sampled_block(first_block + i * stride, stride);
    const BlockCoords b = block_coords(frame, block_id);
    const uint size_x = min(4u, frame->grid.dims_x - 4 * b.x),
               size_y = min(4u, frame->grid.dims_y - 4 * b.y),
               size_z = min(4u, frame->grid.dims_z - 4 * b.z);
    float values[ISO_BLOCK_VOXELS];
    decode_block(part_0, part_1, part_2, part_3, index, layout, block_id, i, values);
    for (uint lattice = 0; lattice < 8; ++lattice) {
      const uint end_x = lattice & 1 ? 1 : size_x, end_y = lattice & 2 ? 1 : size_y,
                 end_z = lattice & 4 ? 1 : size_z;
      VoxelRange range = no_range();
      for (uint z = 0; z < end_z; ++z) {
        for (uint y = 0; y < end_y; ++y) {
          for (uint x = 0; x < end_x; ++x) {
            const float value = values[x + 4 * y + 16 * z];
            VoxelRange voxel;
            voxel.min = voxel.max = value;
            range = join(voxel, range); /* none of NaN */
          }
        }
      }
      partials[8 * (first_partial + i) + lattice] = range;
    }
  }
}

/// Widens the range of all values by those of some blocks. -0 is below 0.
///
/// partials  [num_blocks * 8], see macrocell_partials
/// Out       extremes [2]: bits of the least and of the largest value; those of negative values are
///           flipped but for the sign, so that they are ordered as values are
/// Launch    grid-stride over blocks; few work-items, as each has atomics
kernel void macrocell_extremes(uint num_blocks, global const VoxelRange *partials,
                               global int *extremes) {
  VoxelRange range;
  range.min = INFINITY;
  range.max = -INFINITY;
  for (uint i = get_global_id(0); i < num_blocks; i += get_global_size(0))
    range = join(range, partials[8 * i]);
  const int low = as_int(range.min), high = as_int(range.max);
  atomic_min(&extremes[0], low < 0 ? low ^ 0x7FFFFFFF : low);
  atomic_max(&extremes[1], high < 0 ? high ^ 0x7FFFFFFF : high);
}

/// Makes the 8-bit ranges of the blocks of one layer in z.
///
/// below, above  [blocks_x * blocks_y * 8] the partials of this layer and the next; above is not
///               read in the last layer
/// Out           ranges [blocks]: low in bits 0..7, high in bits 8..15; low > high in blocks that
///               own no dual cell
/// Launch        grid-stride over the layer's blocks
kernel void macrocell_ranges(const FrameParams frame_params, uint layer,
                             global const VoxelRange *below, global const VoxelRange *above,
                             global const float *thresholds, global ushort *ranges) {
  const FrameParams *frame = &frame_params;
  const uint layer_blocks = frame->grid.blocks_x * frame->grid.blocks_y;
  for (uint i = get_global_id(0); i < layer_blocks; i += get_global_size(0)) {
    const uint x = i % frame->grid.blocks_x, y = i / frame->grid.blocks_x;
    const int owns_cells = 4 * x + 1 < frame->grid.dims_x && 4 * y + 1 < frame->grid.dims_y &&
                           4 * layer + 1 < frame->grid.dims_z;
    VoxelRange range = no_range();
    uint low = 255, high = 0;
    for (uint corner = 0; corner < 8; ++corner) {
      const uint nx = x + (corner & 1), ny = y + (corner >> 1 & 1);
      if (nx >= frame->grid.blocks_x || ny >= frame->grid.blocks_y ||
          layer + (corner >> 2) >= frame->grid.blocks_z)
        continue;
      const uint partial = 8 * (nx + frame->grid.blocks_x * ny) + corner;
      range = join(range, (corner & 4 ? above : below)[partial]);
    }
    if (owns_cells && ISO_LABELS) {
      low = (uint)range.min;
      high = (uint)range.max;
    } else if (owns_cells) {
      /* Bisection: thresholds[low] <= min < thresholds[low + 1], and the first threshold >= max. */
      uint end = 255;
      low = 0;
      while (end - low > 1) {
        const uint middle = (low + end) / 2;
        if (thresholds[middle] <= range.min)
          low = middle;
        else
          end = middle;
      }
      uint begin = 0;
      high = 255;
      while (high - begin > 1) {
        const uint middle = (begin + high) / 2;
        if (thresholds[middle] >= range.max)
          high = middle;
        else
          begin = middle;
      }
    }
    ranges[frame->place.ranges_begin + i + layer_blocks * layer] = (ushort)(low | high << 8);
  }
}

/// The block of bit 0..63 of a coarse macrocell, or ISO_INVALID_ID outside the volume.
ISO_INLINE uint macrocell_block(const FrameParams *frame, uint coarse, uint bit) {
  const uint coarse_x = (frame->grid.blocks_x + 3) / 4, coarse_y = (frame->grid.blocks_y + 3) / 4;
  const uint x = 4 * (coarse % coarse_x) + (bit & 3),
             y = 4 * (coarse / coarse_x % coarse_y) + (bit >> 2 & 3),
             z = 4 * (coarse / coarse_x / coarse_y) + (bit >> 4);
  return x < frame->grid.blocks_x && y < frame->grid.blocks_y && z < frame->grid.blocks_z
             ? block_id_at(frame, x, y, z)
             : ISO_INVALID_ID;
}

/// coarse_ranges [num_coarse]: the union of each coarse macrocell's block ranges. Once per volume.
/// Grid-stride.
kernel void macrocell_coarse_ranges(const FrameParams frame_params, uint num_coarse,
                                    global const ushort *ranges, global ushort *coarse_ranges) {
  const FrameParams *frame = &frame_params;
  for (uint coarse = get_global_id(0); coarse < num_coarse; coarse += get_global_size(0)) {
    uint low = 255, high = 0;
    for (uint bit = 0; bit < 64; ++bit) {
      const uint block_id = macrocell_block(frame, coarse, bit);
      if (block_id == ISO_INVALID_ID) continue;
      const uint range = ranges[frame->place.ranges_begin + block_id];
      low = ISO_LABELS ? low & range : min(low, range & 255u);
      high = ISO_LABELS ? high | range >> 8 : max(high, range >> 8);
    }
    coarse_ranges[coarse] = (ushort)(low | high << 8);
  }
}

/// limits: `below` in bits 0..15, `above` in bits 16..31; of labels, a group.
ISO_INLINE int holds_isovalue(uint range, uint limits) {
  if (ISO_LABELS) return (int)((range >> 8 & ~range) >> limits & 1u);
  return (range & 255u) < (limits & 0xFFFFu) && range >> 8 >= limits >> 16;
}

/// The largest code of the bounds of a block and those neighbours whose voxels its dual cells have.
ISO_INLINE uint dual_grid_code(const FrameParams *frame, global const uint *bounds, uint block_id) {
  const BlockCoords b = block_coords(frame, block_id);
  uint code = 0;
  for (uint corner = 0; corner < 8; ++corner) {
    const uint id = dual_grid_block(frame, b, corner);
    if (id != ISO_INVALID_ID) code = max(code, packed_bound_code(bounds, id));
  }
  return code;
}

/// Marks those of the brick's own blocks whose range holds the isovalue. Once per isovalue.
///
/// limits  [256] of blocks by the code of their bound, each as wide as the one before at least;
///         without bounds the first is for all blocks
/// bounds  packed codes, from word bounds_begin on
/// In      box [6]: INT_MAX three times and 0 three times
/// Out     masks [2 * num_coarse]: a bit for each block; box: first and behind the last macrocell
///         with a bit, x, y, z
/// Launch  grid-stride over coarse macrocells
kernel void macrocell_masks(const FrameParams frame_params, uint num_coarse,
                            global const ushort *ranges, global const ushort *coarse_ranges,
                            global const uint *limits, uint has_bounds, global const uint *bounds,
                            uint bounds_begin, global uint *masks, global int *box) {
  const FrameParams *frame = &frame_params;
  const uint widest = limits[has_bounds != 0 ? ISO_BOUND_CODES - 1 : 0];
  for (uint coarse = get_global_id(0); coarse < num_coarse; coarse += get_global_size(0)) {
    uint words[2] = {0, 0};
    if (holds_isovalue(coarse_ranges[coarse], widest)) {
      for (uint bit = 0; bit < 64; ++bit) {
        const uint block_id = macrocell_block(frame, coarse, bit);
        if (block_id == ISO_INVALID_ID || !is_own(frame, block_coords(frame, block_id))) continue;
        const uint range = ranges[frame->place.ranges_begin + block_id];
        if (holds_isovalue(range, widest) &&
            (has_bounds == 0 ||
             holds_isovalue(range, limits[dual_grid_code(frame, bounds + bounds_begin, block_id)])))
          words[bit >> 5] |= 1u << (bit & 31);
      }
    }
    masks[frame->place.masks_begin + 2 * coarse] = words[0];
    masks[frame->place.masks_begin + 2 * coarse + 1] = words[1];
    if ((words[0] | words[1]) != 0) {
      const uint coarse_x = (frame->grid.blocks_x + 3) / 4,
                 coarse_y = (frame->grid.blocks_y + 3) / 4;
      const int at[3] = {(int)(coarse % coarse_x), (int)(coarse / coarse_x % coarse_y),
                         (int)(coarse / coarse_x / coarse_y)};
      for (int axis = 0; axis < 3; ++axis) {
        atomic_min(&box[axis], at[axis]);
        atomic_max(&box[3 + axis], at[axis] + 1);
      }
    }
  }
}
