/// block_cache.cl -- gives cache slots to the blocks that a pass needs (Sec. 3.4, 3.5).
///
/// table: block -> slot (block_table.h). slot_block_ids [slots]: the block in each slot, or
/// ISO_INVALID_ID. changing [slots]: the block's cells in which inside changes, once known.
/// slot_stamps [slots]: when it was used last (slot_stamps.h). free_slots [slots]: the first
/// cache.free_count hold no block. requested_bits: one per block, 0 between passes.
///
/// A pass: cache_request, or march (stamp what is cached, list what is not) -> where free slots may
/// not suffice: cache_rank -> cache_select (how many, which) -> cache_evict -> then cache_assign.
/// All cost O(slots) or O(requests), never O(blocks). The slot that a block gets is left to chance;
/// no hit depends on it.
///
/// Progress is certain: the first block of the first active ray is served before all others. If old
/// slots are too few even for it, slots that other rays use in this very pass are taken; those rays
/// wait for the next. (Not in the paper, whose cache grows instead.)
#include "device/block_pages.h"
#include "device/block_requests.h"
#include "device/ray_pairs.h"
#include "device/work_group.h"
#include "portable/label_table.h"

#define ISO_SPARE_PART 8u  ///< one slot of so many may be freed beyond need

ISO_INLINE uint listed_count(global const PassCounts *counts, uint capacity) {
  return min(counts->requested_count, capacity);
}

/// Whether the pair as far along the ray before has the same block.
ISO_INLINE int asked_beside(const FrameParams *frame, global const uint *pair_block_ids,
                            global const uint *pair_begins, global const uint *pair_rays, uint pair,
                            uint block_id, uint spec_count) {
  uint own = pair, beside = pair - spec_count;
  if (frame->schedule.scanned_pairs) {
    const uint a = pair_rays[pair];
    own = pair_begins[a];
    beside = a == 0 ? own : pair_begins[a - 1] + pair - own;
  } else if (pair < spec_count) {
    beside = own;
  }
  return beside < own && pair_block_ids[beside] == block_id;
}

/// For each pair, stamps the cached blocks of its dual grid and lists the missing ones, once each.
///
/// Out     request_block_ids [counts->requested_count, at most capacity]; slot_stamps
/// Launch  grid-stride over pair slots
kernel void cache_request(const FrameParams frame_params, global PassCounts *counts,
                          global const uint *pair_block_ids, global const uint *pair_begins,
                          global const uint *pair_rays, global const uint *table,
                          global uint *slot_stamps, global uint *requested_bits,
                          global uint *request_block_ids, uint capacity, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  const uint pair_slots = counts->pair_slot_count, spec_count = counts->spec_count,
             pass = counts->pass;
  if (get_global_id(0) == 0) {
    open_requests(cache);
    cache->first_block_id = pair_slots == 0 ? ISO_INVALID_ID : pair_block_ids[0];
    cache->first_touched = 0xFFu;
  }
  for (uint pair = get_global_id(0); pair < pair_slots; pair += get_global_size(0)) {
    const uint block_id = pair_block_ids[pair];
    uint missing[8];
    uint num_missing = 0;
    /* The neighbouring ray's pair asks for the same blocks: let it. Saves most of the work. */
    if (block_id != ISO_INVALID_ID &&
        !asked_beside(frame, pair_block_ids, pair_begins, pair_rays, pair, block_id, spec_count)) {
      const BlockCoords b = block_coords(frame, block_id);
      for (uint corner = 0; corner < 8; ++corner) {
        const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
        if (dual_grid_block(frame, b, corner) != ISO_INVALID_ID &&
            request_block(frame, table, slot_stamps, pass, requested_bits, x, y, z)) {
          missing[num_missing++] = block_id_at(frame, x, y, z);
        }
      }
    }
    if (num_missing != 0) {
      /* One range per pair: when slots run out, dual grids are served whole as far as possible. */
      const uint first = atomic_add(&counts->requested_count, num_missing);
      for (uint i = 0; i < num_missing; ++i) {
        list_request(frame, request_block_ids, capacity, requested_bits, first + i, missing[i]);
      }
    }
  }
}

/// Returns the stamp of a cached block's last use. A ray that reads a block's cells reads its dual
/// grid, but march stamps only the block itself: one stamp costs a GPU less in each pass than
/// eight. So a block counts as read when a block was read whose dual grid it is in, and may have
/// been read if that block was needed since.
ISO_INLINE uint last_use(const FrameParams *frame, global const uint *table,
                         global const uint *slot_stamps, uint block_id, uint stamp) {
  const BlockCoords b = block_coords(frame, block_id);
  const uint below_x = b.x != 0, below_y = b.y != 0, below_z = id_layer(frame, b.z) != 0;
  const uint below = below_x + 2 * below_y + 4 * below_z; /* the corner that the block itself is */
  uint slots[8], latest = stamp;
  find_dual_grid(frame, table, b.x - below_x, b.y - below_y, b.z - below_z, slots);
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    if ((corner & ~below) == 0 && slots[corner] != ISO_BLOCK_ABSENT) {
      const uint read = as_read_stamp(slot_stamps[slots[corner]]);
      if ((int)(read - latest) > 0) latest = read;
    }
  }
  return latest;
}

/// Ranks the slots with blocks for eviction, unless free slots suffice.
///
/// In      rank_histogram [ISO_EVICTION_RANKS]: 0
/// Out     slot_ranks [slots]: eviction_rank(); rank_histogram: how many have each
/// Launch  grid-stride over slots
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void cache_rank(
    const FrameParams frame_params, global const PassCounts *counts, uint num_slots, uint capacity,
    global const CacheState *cache, global const uint *table, global const uint *slot_block_ids,
    global const uint *slot_stamps, global uchar *slot_ranks, global uint *rank_histogram) {
  const FrameParams *frame = &frame_params;
  local uint histogram[ISO_EVICTION_RANKS];
  /* Never a return before a barrier, not even of whole groups: PoCL 3.1 then corrupts memory. */
  const uint requested = listed_count(counts, capacity);
  const int is_short = requested > cache->free_count;
  const uint counted_slots = is_short ? num_slots : 0;
  for (uint rank = get_local_id(0); rank < ISO_EVICTION_RANKS; rank += ISO_GROUP_SIZE)
    histogram[rank] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint slot = get_global_id(0); slot < counted_slots; slot += get_global_size(0)) {
    const uint block_id = slot_block_ids[slot], stamp = slot_stamps[slot];
    if (block_id != ISO_INVALID_ID) {
      uint rank = eviction_rank(stamp, counts);
      if (rank >= ISO_RANKS_OF_FRAME) /* older, so that the others decide whether it is freed
                                         before this frame's */
        rank = eviction_rank(last_use(frame, table, slot_stamps, block_id, stamp), counts);
      slot_ranks[slot] = (uchar)rank;
      atomic_inc(&histogram[rank]);
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint rank = get_local_id(0); rank < ISO_EVICTION_RANKS; rank += ISO_GROUP_SIZE) {
    if (histogram[rank] != 0) atomic_add(&rank_histogram[rank], histogram[rank]);
  }
}

/// Finds the blocks that the ray served first needs: stamps the slots of those that are cached.
/// Returns how many are not. One work-item.
///
/// Out     missing [8]: those
ISO_INLINE uint find_first_blocks(const FrameParams *frame, global const CacheState *cache,
                                  global const uint *table, global uint *slot_stamps, uint stamp,
                                  local uint *missing) {
  const uint block_id = cache->first_block_id; /* invalid: that ray needs nothing */
  uint num_missing = 0;
  for (uint corner = 0; corner < 8 && block_id != ISO_INVALID_ID; ++corner) {
    const BlockCoords b = block_coords(frame, block_id);
    const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
    const uint exists = (uint)exists_where_touched(frame, b, corner);
    if ((cache->first_touched >> corner & exists) != 0) {
      const uint slot = cached_slot(frame, table, x, y, z);
      if (slot != ISO_BLOCK_ABSENT) {
        slot_stamps[slot] = stamp;
      } else {
        missing[num_missing++] = block_id_at(frame, x, y, z);
      }
    }
  }
  return num_missing;
}

/// Puts blocks to the front of the request list: each is swapped to its place; if the list ended
/// too early for it, the block there asks again. One work-item.
///
/// blocks  [num_blocks]
/// places  [num_blocks] where they stand on the list, ISO_INVALID_ID: nowhere; overwritten
ISO_INLINE void put_first(const FrameParams *frame, local const uint *blocks, local uint *places,
                          uint num_blocks, global uint *requested_bits,
                          global uint *request_block_ids) {
  for (uint j = 0; j < num_blocks; ++j) {
    const uint displaced = request_block_ids[j];
    if (places[j] == ISO_INVALID_ID) {
      const BlockCoords b = block_coords(frame, displaced);
      requested_bits[request_word(frame, b.x, b.y, b.z)] &= ~request_bit(frame, b.x, b.y, b.z);
    } else {
      request_block_ids[places[j]] = displaced;
    }
    request_block_ids[j] = blocks[j];
    for (uint later = j + 1; later < num_blocks; ++later) {
      if (places[later] == j) places[later] = places[j];
    }
  }
}

/// Decides how many slots are freed, and of which ranks they are.
///
/// Out     rank_histogram: 0 again
/// Launch  one work-group
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void cache_select(
    const FrameParams frame_params, global const PassCounts *counts, uint num_slots,
    global const uint *table, global uint *slot_stamps, global uint *requested_bits,
    global uint *request_block_ids, uint capacity, global uint *rank_histogram,
    global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  local uint first_missing[8]; /* blocks served first that are not cached */
  local uint places[8];        /* where they stand on the request list */
  local uint num_first_missing, histogram[ISO_EVICTION_RANKS];
  const uint requested = listed_count(counts, capacity), num_free = cache->free_count;
  const uint item = get_local_id(0);
  for (uint rank = item; rank < ISO_EVICTION_RANKS; rank += ISO_GROUP_SIZE) {
    histogram[rank] = rank_histogram[rank];
    rank_histogram[rank] = 0;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint in_use = histogram[0];
  const int scarce = counts->requested_count > min(num_slots - in_use, capacity);
  const uint searched = scarce ? requested : 0;
  if (item == 0) {
    num_first_missing = scarce ? find_first_blocks(frame, cache, table, slot_stamps,
                                                   needed_stamp(counts->pass + 1), first_missing)
                               : 0;
    for (uint j = 0; j < num_first_missing; ++j) places[j] = ISO_INVALID_ID;
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
    uint granted, evicted, rank, before = 0, before_own = 0;
    put_first(frame, first_missing, places, num_first_missing, requested_bits, request_block_ids);
    granted = min(requested, max(num_slots - in_use, num_first_missing));
    evicted = granted > num_free ? granted - num_free : 0;
    if (evicted != 0) { /* some more that neither this frame nor the last has used, so that the next
                           passes need not count again */
      uint unused = 0;
      for (rank = ISO_RANKS_OF_EARLIER; rank < ISO_EVICTION_RANKS; ++rank)
        unused += histogram[rank];
      evicted += min(num_slots / ISO_SPARE_PART, unused - min(unused, evicted));
    }
    for (rank = ISO_EVICTION_RANKS - 1; rank > 0 && before + histogram[rank] < evicted; --rank) {
      before += histogram[rank];
      if (rank >= ISO_RANKS_OF_FRAME) before_own = before;
    }
    cache->free_before = num_free;
    cache->cutoff_rank = evicted == 0 ? ISO_EVICTION_RANKS : rank;
    cache->cutoff_count = evicted - before;
    cache->recycled = rank < ISO_RANKS_OF_FRAME ? evicted - before_own : 0;
    cache->num_evicted = 0;
    cache->num_cutoff = 0;
    cache->free_count = num_free + evicted;
  }
}

/// Frees the selected slots. Grid-stride over slots.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void cache_evict(
    const FrameParams frame_params, global const PassCounts *counts, uint num_slots,
    global uint *slot_block_ids, global const uint *slot_stamps, global const uchar *slot_ranks,
    global uint *table, global CacheState *cache, global uint *free_slots) {
  const FrameParams *frame = &frame_params;
  local uint at_cutoff[2], victims[2];
  const uint item = get_local_id(0), cutoff_rank = cache->cutoff_rank;
  const uint searched =
      counts->requested_count != 0 && cutoff_rank < ISO_EVICTION_RANKS ? num_slots : 0;
  if (item == 0) at_cutoff[0] = victims[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < searched; begin += get_global_size(0)) {
    const uint slot = begin + item;
    const uint block_id = slot < num_slots ? slot_block_ids[slot] : ISO_INVALID_ID;
    const uint may_go =
        block_id != ISO_INVALID_ID && slot_stamps[slot] != needed_stamp(counts->pass + 1);
    const uint rank = may_go ? slot_ranks[slot] : 0;
    const uint is_at_cutoff = may_go && rank == cutoff_rank;
    const uint place = take_place(is_at_cutoff, at_cutoff, &cache->num_cutoff);
    const uint is_victim =
        (may_go && rank > cutoff_rank) || (is_at_cutoff && place < cache->cutoff_count);
    const uint free_place = take_place(is_victim, victims, &cache->num_evicted);
    if (is_victim) {
      remove_block(frame, table, block_coords(frame, block_id));
      slot_block_ids[slot] = ISO_INVALID_ID;
      free_slots[cache->free_before + free_place] = slot;
    }
  }
}

/// Sets the bits of a slot's values that are not below the isovalue. They have this type.
#define ISO_NOT_BELOW(type)                   \
  for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) \
  bits |= (ulong)((float)((global const type *)values)[v] - isovalue >= 0.0f) << v

/// For another isovalue: which voxels of the cached blocks are inside. The type of slots is an
/// argument, or all kernels of this file would be compiled anew for each type.
///
/// slot_type    ISO_SLOTS_*
/// cache_words  slots of ISO_BLOCK_VOXELS values
/// Launch       grid-stride over slots
kernel void cache_classify(const FrameParams frame_params, uint num_slots, uint slot_type,
                           global const uint *slot_block_ids,
                           global const ISO_WORDS(SlotValue) *cache_words, global ulong *inside,
                           global ulong *changing) {
  const FrameParams *frame = &frame_params;
  const float isovalue = frame->surface.isovalue;
  const uint value_bytes = slot_type == ISO_SLOTS_FLOAT32                                  ? 4
                           : slot_type == ISO_SLOTS_UINT16 || slot_type == ISO_SLOTS_INT16 ? 2
                                                                                           : 1;
  for (uint slot = get_global_id(0); slot < num_slots; slot += get_global_size(0)) {
    if (slot_block_ids[slot] != ISO_INVALID_ID) {
      global const uint *values = cache_words + slot * (ISO_BLOCK_VOXELS / 4 * value_bytes);
      ulong bits = 0;
      switch (slot_type) {
        case ISO_SLOTS_FLOAT32:
          ISO_NOT_BELOW(float);
          break;
        case ISO_SLOTS_UINT8:
          ISO_NOT_BELOW(uchar);
          break;
        case ISO_SLOTS_INT8:
          ISO_NOT_BELOW(char);
          break;
        case ISO_SLOTS_UINT16:
          ISO_NOT_BELOW(ushort);
          break;
        case ISO_SLOTS_INT16:
          ISO_NOT_BELOW(short);
          break;
        default:
          for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) {
            const uint groups = ((global const uchar *)values)[v];
            bits |= (ulong)(group_field(groups, frame->surface.isovalue_index) - isovalue >= 0.0f)
                    << v;
          }
      }
      inside[slot] = bits;
      changing[slot] = ISO_CHANGING_UNKNOWN;
    }
  }
}

/// Request i gets the i-th free slot from the end; requests past the last are dropped. Takes the
/// marks of all requests back.
///
/// asked   counts of the pass that listed the requests
/// counts  of the pass at work
/// Out     decode_slots [counts->decoded_count]
/// Launch  grid-stride over requests
kernel void cache_assign(const FrameParams frame_params, global const PassCounts *asked,
                         global PassCounts *counts, global const uint *request_block_ids,
                         uint capacity, global const uint *free_slots, global uint *table,
                         global ulong *changing, global uint *slot_block_ids,
                         global uint *slot_stamps, global uint *requested_bits,
                         global uint *decode_slots, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  const uint listed = listed_count(asked, capacity), num_free = cache->free_count;
  const uint granted = min(listed, num_free);
  if (get_global_id(0) == 0) {
    cache->granted = granted;
    counts->decoded_count = granted;
    counts->free_count = num_free - granted;
    counts->recycled_count = cache->recycled;
  }
  for (uint i = get_global_id(0); i < listed; i += get_global_size(0)) {
    const uint block_id = request_block_ids[i];
    const BlockCoords b = block_coords(frame, block_id);
    requested_bits[request_word(frame, b.x, b.y, b.z)] = 0; /* every mark in it is of this pass */
    if (i < granted) {
      const uint slot = free_slots[num_free - 1 - i];
      table[enter_block(frame, table, b, slot)] = slot;
      changing[slot] = ISO_CHANGING_UNKNOWN;
      slot_block_ids[slot] = block_id;
      slot_stamps[slot] = needed_stamp(asked->pass);
      decode_slots[i] = slot;
    }
  }
}

/// Adds up the cached blocks that rays of the pass have used: for statistics.
///
/// in_dual_grids  those too that are in the dual grid of a block that was read: march stamps just
///                that block, cache_request all eight
/// touched        [1]
/// Launch         grid-stride over slots
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void cache_touched(
    const FrameParams frame_params, global const PassCounts *counts, uint num_slots,
    uint in_dual_grids, global const uint *table, global const uint *slot_block_ids,
    global const uint *slot_stamps, global uint *touched) {
  const FrameParams *frame = &frame_params;
  local uint group_touched;
  const uint now = read_stamp(counts->pass);
  if (get_local_id(0) == 0) group_touched = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint slot = get_global_id(0); slot < num_slots; slot += get_global_size(0)) {
    const uint block_id = slot_block_ids[slot];
    if (block_id != ISO_INVALID_ID) {
      uint stamp = slot_stamps[slot];
      if (in_dual_grids) stamp = last_use(frame, table, slot_stamps, block_id, stamp);
      if ((int)(stamp - now) >= 0) atomic_inc(&group_touched);
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && group_touched != 0) atomic_add(touched, group_touched);
}

/// The cache as it was made: every slot free.
///
/// blocks_x, blocks_y  of the grid in which ids of blocks count
/// directory_words     0, or the length of the directory if it has not been written yet
/// Launch              grid-stride over slots, and the directory
kernel void cache_clear(uint num_slots, uint blocks_x, uint blocks_y, uint directory_words,
                        global uint *table, global uint *slot_block_ids, global uint *slot_stamps,
                        global uint *free_slots, global CacheState *cache) {
  global uint *directory = table + directory_begin(num_slots);
  const uint none = empty_page(num_slots);
  if (get_global_id(0) == 0) {
    cache->free_count = num_slots;
    cache->granted = cache->recycled = 0;
    for (uint i = 0; i < 8; ++i) table[8 * none + i] = ISO_BLOCK_ABSENT;
  }
  for (uint i = get_global_id(0); i < directory_words; i += get_global_size(0)) directory[i] = none;
  for (uint slot = get_global_id(0); slot < num_slots; slot += get_global_size(0)) {
    const uint block_id = directory_words == 0 ? slot_block_ids[slot] : ISO_INVALID_ID;
    if (block_id != ISO_INVALID_ID)
      directory[group_of_block(blocks_x, blocks_y, block_id % blocks_x,
                               block_id / blocks_x % blocks_y, block_id / blocks_x / blocks_y)] =
          none;
    for (uint i = 0; i < 8; ++i) table[8 * slot + i] = ISO_BLOCK_ABSENT; /* page number `slot` */
    table[page_count_at(num_slots, slot)] = 0;
    slot_block_ids[slot] = ISO_INVALID_ID;
    slot_stamps[slot] = 0; /* older than every pass */
    free_slots[slot] = slot;
  }
}
