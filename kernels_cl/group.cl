/// group.cl -- the pass's ray-block pairs that can be intersected now, gathered by block (Sec. 3.6, 4.2).
/// group_select -> compact_indices -> group_keys -> radix_sort -> group_heads -> compact_indices.
#include "block_table.h"

/// pair_active_mask [pair slots] = 1 where every block of the pair's dual grid is cached: all or nothing.
/// Marks all pairs as not tested; intersect overwrites those it tests. Grid-stride.
kernel void group_select(constant FrameParams *frame, global const PassCounts *counts,
                         global const uint *pair_block_ids, global const BlockEntry *table,
                         global PairHit *pair_hits, global uint *pair_active_mask) {
  const uint pair_slots = counts->pair_slot_count;
  for (uint pair = get_global_id(0); pair < pair_slots; pair += get_global_size(0)) {
    const uint block_id = pair_block_ids[pair];
    uint cached = block_id != ISO_INVALID_ID;
    if (cached) {
      const BlockCoords b = block_coords(frame, block_id);
      for (uint corner = 0; corner < 8; ++corner) {
        if (dual_grid_block(frame, b, corner) != ISO_INVALID_ID &&
            cached_slot(frame, table, b.x + (corner & 1), b.y + (corner >> 1 & 1), b.z + (corner >> 2)) ==
                ISO_BLOCK_ABSENT) {
          cached = 0;
        }
      }
    }
    pair_hits[pair].cell = ISO_NOT_TESTED;
    pair_active_mask[pair] = cached;
  }
}

/// keys [granted_count]: the cache slot of each pair's block, which sorts by block with the fewest bits.
/// Grid-stride.
kernel void group_keys(constant FrameParams *frame, global const PassCounts *counts, global const uint *pair_ids,
                       global const uint *pair_block_ids, global const BlockEntry *table, global uint *keys) {
  const uint count = counts->granted_count;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const BlockCoords b = block_coords(frame, pair_block_ids[pair_ids[i]]);
    keys[i] = cached_slot(frame, table, b.x, b.y, b.z);
  }
}

/// mask [granted_count] = 1 at the first pair of each block. Grid-stride.
kernel void group_heads(global const PassCounts *counts, global const uint *keys, global uint *mask) {
  const uint count = counts->granted_count;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0))
    mask[i] = i == 0 || keys[i] != keys[i - 1];
}
