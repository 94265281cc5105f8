/// group.cl -- the pass's ray-block pairs that can be intersected now, gathered by block (Sec. 3.6, 4.2).
///
/// Two ways to the same groups; they differ in the order of the groups and of the pairs in one, on which no hit depends.
///   radix      group_select -> compact_indices -> group_keys -> radix_sort -> group_heads -> compact_indices
///   counting   group_count -> group_tile_sums -> group_offsets -> group_scatter -> group_clear
///
/// Counting: slot_counts [slots] is 0 between passes. A pair takes its rank in its block's group from the count of the
/// block's slot, and whoever gets rank 0 appends the slot to the list of visible ones. That list is scanned, so nothing
/// here costs more than O(pairs), whatever the number of slots or blocks. One array holds the list, then the offsets:
/// block_ray_offsets.
#include "block_table.h"
#include "closest_pair.h"
#include "work_group.h"

#define TILE (ISO_GROUP_SIZE * ISO_SCAN_ITEMS)

/// Whether every block of the dual grid is cached: all or nothing. block_id may be ISO_INVALID_ID: no.
ISO_INLINE int dual_grid_is_cached(const FrameParams *frame, uint block_id, global const BlockEntry *table) {
  int cached = block_id != ISO_INVALID_ID;
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
  return cached;
}

/// The slot of a cached block.
ISO_INLINE uint slot_of(const FrameParams *frame, global const BlockEntry *table, uint block_id) {
  const BlockCoords b = block_coords(frame, block_id);
  return cached_slot(frame, table, b.x, b.y, b.z);
}

/// pair_active_mask [pair slots] = 1 where the pair can be intersected. Marks the others as not tested. Grid-stride.
kernel void group_select(const FrameParams frame_params, global const PassCounts *counts,
                         global const uint *pair_block_ids, global const BlockEntry *table,
                         global PairHit *pair_hits, global uint *closest_pairs,
                         global uint *pair_active_mask) {
  const FrameParams *frame = &frame_params;
  const uint pair_slots = counts->pair_slot_count, spec_count = counts->spec_count;
  for (uint pair = get_global_id(0); pair < pair_slots; pair += get_global_size(0)) {
    const uint block_id = pair_block_ids[pair];
    const int can_be_tested = dual_grid_is_cached(frame, block_id, table);
    if (!can_be_tested) mark_not_tested(pair_hits, closest_pairs, pair, block_id, spec_count);
    pair_active_mask[pair] = (uint)can_be_tested;
  }
}

/// keys [granted_count]: the cache slot of each pair's block, which sorts by block with the fewest bits.
/// Grid-stride.
kernel void group_keys(const FrameParams frame_params, global const PassCounts *counts,
                       global const uint *pair_ids, global const uint *pair_block_ids,
                       global const BlockEntry *table, global uint *keys) {
  const FrameParams *frame = &frame_params;
  const uint count = counts->granted_count;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0))
    keys[i] = slot_of(frame, table, pair_block_ids[pair_ids[i]]);
}

/// mask [granted_count] = 1 at the first pair of each block. Grid-stride.
kernel void group_heads(global const PassCounts *counts, global const uint *keys, global uint *mask) {
  const uint count = counts->granted_count;
  for (uint i = get_global_id(0); i < count; i += get_global_size(0))
    mask[i] = i == 0 || keys[i] != keys[i - 1];
}

/// pair_ranks [pair slots]: place in the group of the pair's block, or ISO_INVALID_ID of a pair that cannot be
/// intersected. Lists the slots of visible blocks, in any order. Marks those as not tested. Groups stride over
/// tiles of pairs; each appends with one global atomic a tile. counts->visible_count: 0 before.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_count(
    const FrameParams frame_params, global PassCounts *counts, global const uint *pair_block_ids,
    global const BlockEntry *table, global PairHit *pair_hits, global uint *closest_pairs,
    global uint *pair_ranks, global uint *slot_counts, global uint *visible_slots) {
  const FrameParams *frame = &frame_params;
  local uint new_slots[TILE];
  local uint num_new, first_place;
  const uint pair_slots = counts->pair_slot_count, item = get_local_id(0);
  for (uint tile = get_group_id(0); tile * TILE < pair_slots; tile += get_num_groups(0)) {
    if (item == 0) num_new = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      const uint pair = tile * TILE + i * ISO_GROUP_SIZE + item;
      if (pair < pair_slots) {
        const uint block_id = pair_block_ids[pair];
        uint rank = ISO_INVALID_ID;
        if (dual_grid_is_cached(frame, block_id, table)) {
          const uint slot = slot_of(frame, table, block_id);
          rank = atomic_inc(&slot_counts[slot]);
          if (rank == 0) new_slots[atomic_inc(&num_new)] = slot;
        } else {
          mark_not_tested(pair_hits, closest_pairs, pair, block_id, counts->spec_count);
        }
        pair_ranks[pair] = rank;
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0 && num_new != 0) first_place = atomic_add(&counts->visible_count, num_new);
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < num_new; i += ISO_GROUP_SIZE) visible_slots[first_place + i] = new_slots[i];
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}

/// tile_sums [tiles of visible blocks] = number of their pairs. Groups stride over tiles.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_tile_sums(
    global const PassCounts *counts, global const uint *visible_slots, global const uint *slot_counts,
    global uint *tile_sums) {
  local uint sums[ISO_GROUP_SIZE];
  const uint visible_count = counts->visible_count;
  for (uint tile = get_group_id(0); tile * TILE < visible_count; tile += get_num_groups(0)) {
    uint sum = 0, total;
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      const uint visible = tile * TILE + i * ISO_GROUP_SIZE + get_local_id(0);
      if (visible < visible_count) sum += slot_counts[visible_slots[visible]];
    }
    group_scan(sums, sum, &total);
    if (get_local_id(0) == 0) tile_sums[tile] = total;
  }
}

/// block_ray_offsets [visible_count]: the list of visible slots before, where each one's pairs begin after;
/// slot_counts: pairs before, the same offset after. Groups stride over tiles; each sums up the tiles before its own,
/// which are too few for a launch between.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_offsets(
    global PassCounts *counts, global const uint *tile_sums, global uint *slot_counts,
    global uint *block_ray_offsets) {
  local uint sums[ISO_GROUP_SIZE];
  const uint visible_count = counts->visible_count;
  uint before = 0, next_tile = 0; /* pairs of the tiles before next_tile */
  for (uint tile = get_group_id(0); tile * TILE < visible_count; tile += get_num_groups(0)) {
    const uint begin = tile * TILE + get_local_id(0) * ISO_SCAN_ITEMS;
    uint own_slots[ISO_SCAN_ITEMS], own_counts[ISO_SCAN_ITEMS];
    uint skipped = 0, sum = 0, total, offset;
    for (uint i = next_tile + get_local_id(0); i < tile; i += ISO_GROUP_SIZE) skipped += tile_sums[i];
    group_scan(sums, skipped, &total);
    before += total;
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      own_slots[i] = begin + i < visible_count ? block_ray_offsets[begin + i] : ISO_INVALID_ID;
      own_counts[i] = begin + i < visible_count ? slot_counts[own_slots[i]] : 0;
      sum += own_counts[i];
    }
    offset = before + group_scan(sums, sum, &total);
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      if (begin + i < visible_count) {
        block_ray_offsets[begin + i] = offset;
        slot_counts[own_slots[i]] = offset;
      }
      offset += own_counts[i];
    }
    before += total;
    next_tile = tile + 1;
    if (get_local_id(0) == 0 && next_tile * TILE >= visible_count) counts->granted_count = before;
  }
}

/// pair_ids, slots [granted_count]: the pairs in their groups. slot_offsets: slot_counts after group_offsets.
/// Grid-stride over pair slots.
kernel void group_scatter(const FrameParams frame_params, global const PassCounts *counts,
                          global const uint *pair_block_ids, global const BlockEntry *table,
                          global const uint *pair_ranks, global const uint *slot_offsets,
                          global uint *pair_ids, global uint *slots) {
  const FrameParams *frame = &frame_params;
  const uint pair_slots = counts->pair_slot_count;
  for (uint pair = get_global_id(0); pair < pair_slots; pair += get_global_size(0)) {
    const uint rank = pair_ranks[pair];
    if (rank != ISO_INVALID_ID) {
      const uint slot = slot_of(frame, table, pair_block_ids[pair]);
      const uint to = slot_offsets[slot] + rank;
      pair_ids[to] = pair;
      slots[to] = slot;
    }
  }
}

/// slot_counts of the visible blocks = 0, for the next pass. Grid-stride.
kernel void group_clear(global const PassCounts *counts, global const uint *slots,
                        global const uint *block_ray_offsets, global uint *slot_counts) {
  const uint visible_count = counts->visible_count;
  for (uint visible = get_global_id(0); visible < visible_count; visible += get_global_size(0))
    slot_counts[slots[block_ray_offsets[visible]]] = 0;
}
