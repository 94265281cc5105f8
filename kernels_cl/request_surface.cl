/// request_surface.cl -- the blocks that a mesh is made of, asked for in the block cache.
///
/// A listed block's triangles need its dual grid; gradients at their vertices need the blocks
/// before each voxel of that, too (mesh_needs_neighbour()).
#include "device/block_requests.h"
#include "portable/marching_cubes.h"

/// Is there block b + (dx,dy,dz), dx .. dz -1, 0 or 1, and is it needed? neighbour: of 27, by dx,
/// then dy, dz.
ISO_INLINE int needed_neighbour(const FrameParams *frame, BlockCoords b, uint neighbour,
                                int with_gradients, BlockCoords *at) {
  const int dx = (int)(neighbour % 3) - 1, dy = (int)(neighbour / 3 % 3) - 1,
            dz = (int)(neighbour / 9) - 1;
  at->x = b.x + (uint)dx; /* before the first block, these wrap around to large numbers */
  at->y = b.y + (uint)dy;
  at->z = b.z + (uint)dz;
  return mesh_needs_neighbour(dx, dy, dz, with_gradients) && at->x < frame->grid.blocks_x &&
         at->y < frame->grid.blocks_y && at->z < frame->grid.blocks_z;
}

/// Lists the missing ones of the blocks that entries [begin, end) of the list need, once each, and
/// stamps the cached ones.
///
/// Out     request_block_ids [counts->requested_count, at most capacity]; slot_stamps
/// Launch  grid-stride over entries
kernel void request_surface(const FrameParams frame_params, uint begin, uint end,
                            uint with_gradients, global const uint *block_ids,
                            global PassCounts *counts, global const uint *table,
                            global uint *slot_stamps, global uint *requested_bits,
                            global uint *request_block_ids, uint capacity,
                            global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  const uint pass = counts->pass;
  if (get_global_id(0) == 0) {
    open_requests(cache);
    cache->first_block_id = ISO_INVALID_ID; /* if these are too many, the host asks for fewer */
    cache->first_touched = 0;
  }
  for (uint i = begin + get_global_id(0); i < end; i += get_global_size(0)) {
    const BlockCoords b = block_coords(frame, block_ids[i]);
    uint missing[ISO_MESH_NEIGHBOURS], num_missing = 0;
    for (uint neighbour = 0; neighbour < 27; ++neighbour) {
      BlockCoords at;
      if (needed_neighbour(frame, b, neighbour, (int)with_gradients, &at) &&
          request_block(frame, table, slot_stamps, pass, requested_bits, at.x, at.y, at.z))
        missing[num_missing++] = block_id_at(frame, at.x, at.y, at.z);
    }
    if (num_missing != 0) {
      const uint first = atomic_add(&counts->requested_count, num_missing);
      for (uint k = 0; k < num_missing; ++k)
        list_request(frame, request_block_ids, capacity, requested_bits, first + k, missing[k]);
    }
  }
}

/// Counts the different blocks that entries [0, count) need.
///
/// In      marks [2 * coarse macrocells]: 0; num_needed [1]: 0
/// Launch  grid-stride over entries
kernel void count_needed(const FrameParams frame_params, uint count, uint with_gradients,
                         global const uint *block_ids, global uint *marks,
                         global uint *num_needed) {
  const FrameParams *frame = &frame_params;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const BlockCoords b = block_coords(frame, block_ids[i]);
    uint num_new = 0;
    for (uint neighbour = 0; neighbour < 27; ++neighbour) {
      BlockCoords at;
      if (needed_neighbour(frame, b, neighbour, (int)with_gradients, &at))
        num_new += (uint)mark_request(frame, marks, at.x, at.y, at.z);
    }
    if (num_new != 0) atomic_add(num_needed, num_new);
  }
}
