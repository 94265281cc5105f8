/// group.cl -- the pass's ray-block pairs that can be intersected now, gathered by block
/// (Sec. 3.6, 4.2).
///
/// Two ways to the same groups; they differ in the order of the groups and of the pairs in one, on
/// which no hit depends.
///   radix      group_select -> radix_sort -> group_head_sums -> group_heads
///   counting   group_count -> group_blocks -> group_scatter
///
/// Counting: slot_counts [slots] and candidate_count are 0 between passes. A pair whose own block
/// is cached takes its rank among the pairs of that block from the count of the block's slot, and
/// the pair that gets rank 0 lists the slot as a candidate. Only then is each candidate's dual grid
/// looked up: eight blocks a block, not eight a pair. The visible ones draw places for their pairs,
/// in whatever order they come. Nothing here costs more than O(pairs), whatever the number of slots
/// or blocks.
#include "device/closest_pair.h"
#include "device/ray_pairs.h"
#include "device/work_group.h"
#include "portable/block_table.h"

/// Whether every block of the dual grid of block b is cached: all or nothing. slot: its own.
ISO_INLINE int dual_grid_is_cached(const FrameParams *frame, BlockCoords b,
                                   global const uint *table, uint *slot) {
  const uint outside = (b.x + 1 == frame->grid.blocks_x ? 0xAAu : 0u) |
                       (b.y + 1 == frame->grid.blocks_y ? 0xCCu : 0u) |
                       (b.z + 1 == frame->grid.blocks_z ? 0xF0u : 0u);
  uint slots[8], absent = 0;
  find_dual_grid(frame, table, b.x, b.y, b.z, slots);
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner)
    absent |= (uint)(slots[corner] == ISO_BLOCK_ABSENT) << corner;
  *slot = slots[0];
  return (absent & ~outside) == 0;
}

#define PAIR_TILE (ISO_GROUP_SIZE * ISO_GROUP_ITEMS)

/// Lists the pairs that can be intersected, and marks the others as not tested.
///
/// In      counts->granted_count: 0
/// Out     pair_ids, keys [granted_count]: the pairs, and the cache slots of their blocks, which
///         sort by block with the fewest bits
/// Launch  groups stride over tiles of pairs; each appends with one global atomic a tile
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_select(
    const FrameParams frame_params, global PassCounts *counts, global const uint *pair_block_ids,
    global const uint *table, global const uint *pair_rays, global PairHit *pair_hits,
    global uint *closest_pairs, global uint *pair_ids, global uint *keys) {
  const FrameParams *frame = &frame_params;
  local uint num_granted, first_place;
  const uint pair_slots = counts->pair_slot_count, spec_count = counts->spec_count,
             item = get_local_id(0);
  for (uint tile = get_group_id(0); tile * PAIR_TILE < pair_slots; tile += get_num_groups(0)) {
    uint slots[ISO_GROUP_ITEMS], places[ISO_GROUP_ITEMS];
    if (item == 0) num_granted = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = 0; i < ISO_GROUP_ITEMS; ++i) {
      const uint pair = tile * PAIR_TILE + i * ISO_GROUP_SIZE + item;
      places[i] = ISO_INVALID_ID;
      if (pair < pair_slots) {
        const uint block_id = pair_block_ids[pair];
        if (block_id != ISO_INVALID_ID &&
            dual_grid_is_cached(frame, block_coords(frame, block_id), table, &slots[i])) {
          places[i] = atomic_inc(&num_granted);
        } else {
          mark_not_tested(pair_hits, closest_pairs, ray_of_pair(frame, pair_rays, pair, spec_count),
                          pair, block_id);
        }
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0 && num_granted != 0)
      first_place = atomic_add(&counts->granted_count, num_granted);
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = 0; i < ISO_GROUP_ITEMS; ++i) {
      if (places[i] != ISO_INVALID_ID) {
        pair_ids[first_place + places[i]] = tile * PAIR_TILE + i * ISO_GROUP_SIZE + item;
        keys[first_place + places[i]] = slots[i];
      }
    }
  }
}

#define KEY_TILE (ISO_GROUP_SIZE * ISO_SCAN_ITEMS)

ISO_INLINE int starts_block(global const uint *keys, uint i) {
  return i == 0 || keys[i] != keys[i - 1];
}

/// Out     tile_sums [tiles of sorted keys]: how many blocks start there
/// Launch  groups stride over tiles
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_head_sums(
    global const PassCounts *counts, global const uint *keys, global uint *tile_sums) {
  local uint num_heads;
  const uint count = counts->granted_count, item = get_local_id(0);
  for (uint tile = get_group_id(0); tile * KEY_TILE < count; tile += get_num_groups(0)) {
    uint heads = 0;
    if (item == 0) num_heads = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      const uint entry = tile * KEY_TILE + i * ISO_GROUP_SIZE + item;
      heads += entry < count && starts_block(keys, entry);
    }
    if (heads != 0) atomic_add(&num_heads, heads);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) tile_sums[tile] = num_heads;
  }
}

/// Finds where each block's pairs begin and end.
///
/// In      counts->visible_count: 0
/// Out     block_rays [visible_count], in the order of the keys
/// Launch  groups stride over tiles; each sums up the tiles before its own, which are too few for a
///         launch between
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_heads(
    global PassCounts *counts, global const uint *keys, global const uint *tile_sums,
    global BlockRays *block_rays) {
  local uint sums[ISO_GROUP_SIZE];
  const uint count = counts->granted_count;
  uint before = 0, next_tile = 0; /* blocks that start in the tiles before next_tile */
  for (uint tile = get_group_id(0); tile * KEY_TILE < count; tile += get_num_groups(0)) {
    const uint begin = tile * KEY_TILE + get_local_id(0) * ISO_SCAN_ITEMS;
    const uint end = min(begin + ISO_SCAN_ITEMS, count);
    uint skipped = 0, heads = 0, total, visible;
    for (uint i = next_tile + get_local_id(0); i < tile; i += ISO_GROUP_SIZE)
      skipped += tile_sums[i];
    group_scan(sums, skipped, &total);
    before += total;
    for (uint i = begin; i < end; ++i) heads += starts_block(keys, i);
    visible = before + group_scan(sums, heads, &total);
    for (uint i = begin; i < end; ++i) {
      if (starts_block(keys, i)) block_rays[visible++].begin = i;
      if (i + 1 == count || keys[i + 1] != keys[i]) block_rays[visible - 1].end = i + 1;
    }
    before += total;
    next_tile = tile + 1;
    if (get_local_id(0) == 0 && next_tile * KEY_TILE >= count) counts->visible_count = before;
  }
}

/// slots [ISO_GROUP_ITEMS]: of these blocks; ISO_BLOCK_ABSENT of one that is not cached, and of
/// ISO_INVALID_ID. In steps for all of them, as find_dual_grid().
ISO_INLINE void find_slots(const FrameParams *frame, global const uint *table,
                           const uint *block_ids, uint *slots) {
  uint pages[ISO_GROUP_ITEMS];
  ISO_UNROLL
  for (uint i = 0; i < ISO_GROUP_ITEMS; ++i) {
    const BlockCoords b = block_coords(frame, block_ids[i]);
    pages[i] = block_ids[i] == ISO_INVALID_ID ? empty_page(frame->schedule.cache_slots)
                                              : table[directory_word(frame, b.x, b.y, b.z)];
  }
  ISO_UNROLL
  for (uint i = 0; i < ISO_GROUP_ITEMS; ++i) {
    const BlockCoords b = block_coords(frame, block_ids[i]);
    slots[i] = table[page_word(frame, pages[i], b.x, b.y, b.z)];
  }
}

/// Counts the pairs of each cached block, and lists the slots of those blocks.
///
/// Out     pair_slots [pair slots]: the cache slot of each pair's block, or ISO_BLOCK_ABSENT;
///         pair_ranks [pair slots]: its place among the pairs of that block, if cached
/// Launch  groups stride over tiles of pairs; each appends with one global atomic a tile
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_count(
    const FrameParams frame_params, global const PassCounts *counts,
    global const uint *pair_block_ids, global const uint *table, global uint *pair_slots,
    global uint *pair_ranks, global uint *slot_counts, global uint *candidate_slots,
    global uint *candidate_count) {
  const FrameParams *frame = &frame_params;
  local uint new_slots[PAIR_TILE];
  local uint num_staged, first_place;
  const uint count = counts->pair_slot_count, item = get_local_id(0);
  for (uint tile = get_group_id(0); tile * PAIR_TILE < count; tile += get_num_groups(0)) {
    const uint first = tile * PAIR_TILE + item;
    uint block_ids[ISO_GROUP_ITEMS], slots[ISO_GROUP_ITEMS], ranks[ISO_GROUP_ITEMS], num_new;
    if (item == 0) num_staged = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    /* Step by step for all of the work-item's pairs, so that their loads and atomics are under way
     * together. */
    ISO_UNROLL
    for (uint i = 0; i < ISO_GROUP_ITEMS; ++i) {
      const uint pair = first + i * ISO_GROUP_SIZE;
      block_ids[i] = pair < count ? pair_block_ids[pair] : ISO_INVALID_ID;
    }
    find_slots(frame, table, block_ids, slots);
    ISO_UNROLL
    for (uint i = 0; i < ISO_GROUP_ITEMS; ++i)
      ranks[i] = slots[i] == ISO_BLOCK_ABSENT ? ISO_INVALID_ID : atomic_inc(&slot_counts[slots[i]]);
    ISO_UNROLL
    for (uint i = 0; i < ISO_GROUP_ITEMS; ++i) {
      const uint pair = first + i * ISO_GROUP_SIZE;
      if (pair < count) {
        pair_slots[pair] = slots[i];
        pair_ranks[pair] = ranks[i];
      }
      if (ranks[i] == 0) new_slots[atomic_inc(&num_staged)] = slots[i];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    num_new = num_staged;
    if (item == 0 && num_new != 0) first_place = atomic_add(candidate_count, num_new);
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < num_new; i += ISO_GROUP_SIZE)
      candidate_slots[first_place + i] = new_slots[i];
  }
}

/// Gives each candidate whose dual grid is cached a place for its pairs.
///
/// In      counts->granted_count, visible_count: 0
/// Out     block_rays [visible_count], in any order; slot_offsets [slots]: where the pairs of each
///         candidate begin, or ISO_INVALID_ID if it is not visible; slot_counts of the
///         candidates: 0, for the next pass
/// Launch  groups stride over the candidates; each draws places with two global atomics a turn
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void group_blocks(
    const FrameParams frame_params, global PassCounts *counts, global const uint *candidate_slots,
    global const uint *candidate_count, global const uint *slot_block_ids, global const uint *table,
    global uint *slot_counts, global uint *slot_offsets, global BlockRays *block_rays) {
  const FrameParams *frame = &frame_params;
  local uint num_blocks, num_pairs, first_block, first_pair;
  const uint candidates = *candidate_count, item = get_local_id(0);
  for (uint first = get_group_id(0) * ISO_GROUP_SIZE; first < candidates;
       first += get_num_groups(0) * ISO_GROUP_SIZE) {
    uint slot = ISO_INVALID_ID, pairs = 0, block = 0, offset = 0;
    if (item == 0) num_blocks = num_pairs = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (first + item < candidates) {
      uint own_slot;
      slot = candidate_slots[first + item];
      if (dual_grid_is_cached(frame, block_coords(frame, slot_block_ids[slot]), table, &own_slot)) {
        pairs = slot_counts[slot];
        block = atomic_inc(&num_blocks);
        offset = atomic_add(&num_pairs, pairs);
      }
      slot_counts[slot] = 0;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0 && num_blocks != 0) {
      first_block = atomic_add(&counts->visible_count, num_blocks);
      first_pair = atomic_add(&counts->granted_count, num_pairs);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (slot != ISO_INVALID_ID)
      slot_offsets[slot] = pairs == 0 ? ISO_INVALID_ID : first_pair + offset;
    if (pairs != 0) {
      block_rays[first_block + block].begin = first_pair + offset;
      block_rays[first_block + block].end = first_pair + offset + pairs;
    }
  }
}

/// Moves pairs to their groups, and marks the others as not tested.
///
/// Out     pair_ids [granted_count]; candidate_count: 0, for the next pass
/// Launch  grid-stride over pair slots
kernel void group_scatter(const FrameParams frame_params, global const PassCounts *counts,
                          global const uint *pair_block_ids, global const uint *pair_slots,
                          global const uint *pair_ranks, global const uint *slot_offsets,
                          global const uint *pair_rays, global PairHit *pair_hits,
                          global uint *closest_pairs, global uint *pair_ids,
                          global uint *candidate_count) {
  const FrameParams *frame = &frame_params;
  const uint count = counts->pair_slot_count, spec_count = counts->spec_count;
  if (get_global_id(0) == 0) *candidate_count = 0;
  for (uint pair = get_global_id(0); pair < count; pair += get_global_size(0)) {
    const uint slot = pair_slots[pair], rank = pair_ranks[pair];
    const uint offset = slot == ISO_BLOCK_ABSENT ? ISO_INVALID_ID : slot_offsets[slot];
    if (offset != ISO_INVALID_ID) {
      pair_ids[offset + rank] = pair;
    } else {
      mark_not_tested(pair_hits, closest_pairs, ray_of_pair(frame, pair_rays, pair, spec_count),
                      pair, pair_block_ids[pair]);
    }
  }
}
