/// block_cache.cl -- gives cache slots to the blocks that a pass needs (Sec. 3.4, 3.5).
///
/// page_table [blocks]: slot of a cached block, ISO_BLOCK_ABSENT or ISO_BLOCK_REQUESTED.
/// slot_block_ids [slots]: the block in each slot, or ISO_INVALID_ID. slot_stamps [slots]: pass that used it
/// last.
///
/// A pass: cache_request (stamp what is cached, list what is not) -> cache_age_histogram -> cache_select (how
/// many, how old) -> cache_collect_victims -> cache_assign. The last four cost O(slots) or O(requests), never
/// O(blocks), and do nothing when nothing is asked for. Which block gets which slot is left to chance; no hit
/// depends on it.
///
/// Progress is certain: the first pair of the lowest-numbered active ray is served before all others. If old
/// slots are too few even for it, slots that other pairs use in this very pass are taken; those pairs wait
/// for the next. (Not in the paper, whose cache grows instead.)
#include "block_grid.h"

/// The outcome of cache_select, read by the kernels behind it.
typedef struct CacheSelection {
  uint victim_count;   ///< slots to free = requests to grant
  uint cutoff_age;     ///< all slots older than this are victims ...
  uint cutoff_count;   ///< ... and this many of just this age
  uint num_collected;  ///< victims listed so far
  uint num_cutoff;     ///< tickets drawn by slots of the cutoff age
} CacheSelection;

/// A slot that holds blocks of the pair served first is stamped with the next pass: younger than all.
inline uint slot_age(uint stamp, uint pass) {
  return min(pass - stamp, ISO_AGE_BUCKETS - 1);
}

/// Per pair: stamps the cached blocks of its dual grid and appends the missing ones, once each, to the
/// request list. Grid-stride over pair slots.
kernel void cache_request(constant FrameParams *frame, global PassCounts *counts,
                          global const uint *pair_block_ids, global uint *page_table,
                          global uint *slot_stamps, global uint *request_block_ids) {
  const uint pair_slots = counts->pair_slot_count, spec_count = counts->spec_count, pass = counts->pass;
  for (uint pair = get_global_id(0); pair < pair_slots; pair += get_global_size(0)) {
    const uint block_id = pair_block_ids[pair];
    uint missing[8];
    uint num_missing = 0;
    /* The neighbouring ray's pair asks for the same blocks: let it. Saves most of the atomics. */
    if (block_id == ISO_INVALID_ID || (pair >= spec_count && pair_block_ids[pair - spec_count] == block_id))
      continue;
    const BlockCoords b = block_coords(frame, block_id);
    for (uint corner = 0; corner < 8; ++corner) {
      const uint needed = dual_grid_block(frame, b, corner);
      if (needed == ISO_INVALID_ID) continue;
      const uint entry = atomic_cmpxchg(&page_table[needed], ISO_BLOCK_ABSENT, ISO_BLOCK_REQUESTED);
      if (entry == ISO_BLOCK_ABSENT) {
        missing[num_missing++] = needed;
      } else if (entry != ISO_BLOCK_REQUESTED) {
        slot_stamps[entry] = pass;
      }
    }
    if (num_missing != 0) {
      /* One range per pair: when slots run out, dual grids are served whole as far as possible. */
      const uint first = atomic_add(&counts->requested_count, num_missing);
      for (uint i = 0; i < num_missing; ++i) request_block_ids[first + i] = missing[i];
    }
  }
}

/// Counts slots by age. age_histogram [ISO_AGE_BUCKETS]: zero before. Grid-stride over slots.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void cache_age_histogram(
    global const PassCounts *counts, uint num_slots, global const uint *slot_stamps,
    global uint *age_histogram) {
  local uint histogram[ISO_AGE_BUCKETS];
  const uint pass = counts->pass;
  /* Never a return before a barrier, not even of whole groups: PoCL 3.1 then corrupts memory. */
  const uint counted_slots = counts->requested_count == 0 ? 0 : num_slots;
  for (uint age = get_local_id(0); age < ISO_AGE_BUCKETS; age += ISO_GROUP_SIZE) histogram[age] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint slot = get_global_id(0); slot < counted_slots; slot += get_global_size(0)) {
    atomic_inc(&histogram[slot_age(slot_stamps[slot], pass)]);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint age = get_local_id(0); age < ISO_AGE_BUCKETS; age += ISO_GROUP_SIZE) {
    if (histogram[age] != 0) atomic_add(&age_histogram[age], histogram[age]);
  }
}

/// Decides how many requests are granted and which ages pay for it. One work-group. age_histogram is zeroed
/// again.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void cache_select(
    constant FrameParams *frame, global PassCounts *counts, uint num_slots, global const uint *pair_block_ids,
    global const uint *page_table, global uint *slot_stamps, global uint *request_block_ids,
    global uint *age_histogram, global CacheSelection *selection) {
  local uint first_missing[8]; /* blocks of the pair served first that are on the request list */
  local uint places[8];        /* where they stand there */
  local uint num_first_missing;
  const uint requested = counts->requested_count;
  const uint in_use = age_histogram[0];
  const uint item = get_local_id(0);
  const int scarce = requested > num_slots - in_use;
  const uint searched = scarce ? requested : 0;
  if (item == 0) {
    const uint block_id = pair_block_ids[0]; /* invalid: that ray is leaving the volume and needs nothing */
    num_first_missing = 0;
    for (uint corner = 0; corner < 8 && scarce && block_id != ISO_INVALID_ID; ++corner) {
      const uint needed = dual_grid_block(frame, block_coords(frame, block_id), corner);
      if (needed == ISO_INVALID_ID) continue;
      if (page_table[needed] == ISO_BLOCK_REQUESTED) {
        first_missing[num_first_missing++] = needed;
      } else {
        slot_stamps[page_table[needed]] = counts->pass + 1;
      }
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = item; i < searched; i += ISO_GROUP_SIZE) {
    const uint wanted = request_block_ids[i];
    for (uint j = 0; j < num_first_missing; ++j) {
      if (first_missing[j] == wanted) places[j] = i;
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
  if (item == 0) {
    uint granted, age, older = 0;
    for (uint j = 0; j < num_first_missing; ++j) { /* swap it to place j */
      const uint displaced = request_block_ids[j];
      request_block_ids[places[j]] = displaced;
      request_block_ids[j] = first_missing[j];
      for (uint later = j + 1; later < num_first_missing; ++later) {
        if (places[later] == j) places[later] = places[j];
      }
    }
    granted = min(requested, max(num_slots - in_use, num_first_missing));
    for (age = ISO_AGE_BUCKETS - 1; age > 0 && older + age_histogram[age] < granted; --age) {
      older += age_histogram[age];
    }
    selection->victim_count = granted;
    selection->cutoff_age = age;
    selection->cutoff_count = granted - older;
    selection->num_collected = 0;
    selection->num_cutoff = 0;
    counts->decoded_count = granted;
  }
  barrier(CLK_GLOBAL_MEM_FENCE); /* the histogram has been read */
  for (uint age = item; age < ISO_AGE_BUCKETS; age += ISO_GROUP_SIZE) age_histogram[age] = 0;
}

/// Lists the slots that are freed. Grid-stride over slots.
kernel void cache_collect_victims(global const PassCounts *counts, uint num_slots,
                                  global const uint *slot_stamps, global CacheSelection *selection,
                                  global uint *victim_slots) {
  const uint pass = counts->pass;
  if (counts->requested_count == 0) return;
  for (uint slot = get_global_id(0); slot < num_slots; slot += get_global_size(0)) {
    const uint stamp = slot_stamps[slot];
    const uint age = slot_age(stamp, pass);
    if (stamp == pass + 1 || age < selection->cutoff_age) continue;
    if (age == selection->cutoff_age && atomic_inc(&selection->num_cutoff) >= selection->cutoff_count)
      continue;
    victim_slots[atomic_inc(&selection->num_collected)] = slot;
  }
}

/// Request i gets victim i; requests past the last victim are dropped. Grid-stride over requests.
kernel void cache_assign(global const PassCounts *counts, global const uint *request_block_ids,
                         global const uint *victim_slots, global uint *page_table,
                         global uint *slot_block_ids, global uint *slot_stamps) {
  const uint requested = counts->requested_count, granted = counts->decoded_count;
  for (uint i = get_global_id(0); i < requested; i += get_global_size(0)) {
    const uint block_id = request_block_ids[i];
    if (i < granted) {
      const uint slot = victim_slots[i];
      const uint evicted = slot_block_ids[slot];
      if (evicted != ISO_INVALID_ID) page_table[evicted] = ISO_BLOCK_ABSENT;
      page_table[block_id] = slot;
      slot_block_ids[slot] = block_id;
      slot_stamps[slot] = counts->pass;
    } else {
      page_table[block_id] = ISO_BLOCK_ABSENT;
    }
  }
}
