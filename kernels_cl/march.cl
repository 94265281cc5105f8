/// march.cl -- pipeline `rays`: each ray walks through the active blocks and intersects those that
/// are cached, until it hits, leaves, or comes to one that is not: there it waits (Sec. 3.3, 3.7).
///
/// start_rays -> march -> request_ahead -> [ cache -> decode -> march -> request_ahead ]*. No sort
/// and no composite: a ray's blocks come in ray order, so its first change is its hit.
#include "device/level_borders.h"
#include "device/march_block.h"
#include "device/march_pass.h"
#include "device/ray_lanes.h"
#include "device/ray_source.h"
#include "device/work_group.h"

/// A ray as one of its work-items sees it. A ray has `lanes` work-items, and each has a lane: it
/// walks the round's blocks at places lane, lane + lanes, ...
typedef struct RayMarch {
  RayEntry entry;
  RayStand stand;
  uint hit_cell;  ///< HitRecord::cell of the ray's last hit, if it stands there
  uint lane, lanes;
  uint next;  ///< the block that the next round begins with; ISO_INVALID_ID: none is left
  ISO_SCRATCH uint *blocks;  ///< [num_blocks] of the round, ISO_SCRATCH_STRIDE apart
  uint num_blocks;
  uint num_passed;               ///< blocks of this lane in which nothing happened
  int result;                    ///< ISO_RAY_*: what happened in this lane ...
  uint waits_at, place;          ///< ... in this block, at this place of the round
  volatile local uint *decides;  ///< the first such place of all lanes, or ISO_INVALID_ID
  BlockChange change;
  int goes_on;  ///< there is another round
  int is_gone;  ///< nothing has happened, and no block is left
} RayMarch;

ISO_INLINE RayMarch begin_march(global const uint *active_ray_ids, global const uint *ray_block_ids,
                                global const HitRecord *hits, uint num_rays, uint i, uint lane,
                                uint lanes) {
  const int is_ray = i < num_rays;
  RayMarch m;
  m.entry = unpack_entry(is_ray ? active_ray_ids[i] : 0);
  m.stand = read_stand(is_ray ? ray_block_ids[m.entry.pixel] : ISO_INVALID_ID);
  m.hit_cell = ISO_BEHIND_HITS && is_ray ? hits[m.entry.pixel].cell : 0u;
  m.lane = lane;
  m.lanes = lanes;
  m.next = m.stand.block_id;
  m.waits_at = m.place = 0;
  m.result = ISO_RAY_LEFT;
  m.goes_on = is_ray;
  m.is_gone = 0;
  return m;
}

/// Finds the blocks of a round.
ISO_INLINE void find_round(const FrameParams *level, global const uint *macrocell_masks,
                           const Ray *ray, LastPlanes last, int is_first, RayMarch *m) {
  if (is_first && m->lanes == 1) { /* most rays of a cold frame wait right there */
    m->blocks[0] = m->next;
    m->num_blocks = 1;
    m->next = block_behind_stand(level, ray, block_coords(level, m->next), m->stand.side, last);
  } else {
    m->num_blocks =
        find_blocks_from(level, macrocell_masks, ray, is_first ? m->stand.side : ISO_SIDE_UNKNOWN,
                         &m->next, ISO_BLOCKS_AT_ONCE, m->blocks);
  }
}

/// Walks this lane's blocks of a round, up to the first in which something happens.
ISO_INLINE void walk_round(const FrameParams *level, const CacheReader *cache, const Ray *ray,
                           LastPlanes last, int is_first, RayMarch *m) {
  for (uint at = m->lane; at < m->num_blocks && m->result == ISO_RAY_LEFT; at += m->lanes) {
    const uint block_id = m->blocks[at * ISO_SCRATCH_STRIDE];
    const int stands_here = is_first && at == 0;
    const int may_end = m->next == ISO_INVALID_ID && at + 1 == m->num_blocks;
    m->result = march_block(level, cache, ray, last, block_coords(level, block_id),
                            stands_here && m->entry.in_doubt != 0,
                            stands_here ? m->stand.side : ISO_SIDE_UNKNOWN, m->hit_cell, may_end,
                            &m->change);
    if (m->result == ISO_RAY_LEFT) {
      ++m->num_passed;
    } else {
      atomic_min(m->decides, at);
      m->place = at;
      m->waits_at = block_id;
    }
  }
}

/// Ends a round that all lanes have walked. The first place at which something happens decides, and
/// what other lanes found is void. Returns how many blocks of this lane are before that place.
ISO_INLINE uint decide_round(RayMarch *m) {
  const uint place = *m->decides;
  if (m->place != place) m->result = ISO_RAY_LEFT;
  m->goes_on = place == ISO_INVALID_ID && m->next != ISO_INVALID_ID;
  m->is_gone = place == ISO_INVALID_ID && m->next == ISO_INVALID_ID;
  return m->lane < place ? min(m->num_passed, (place - m->lane - 1) / m->lanes + 1) : 0;
}

/// Stores the place of a ray that has no more rounds, if the ray waits.
///
/// behind   the block behind the border of its band, or ISO_INVALID_ID
/// Returns  whether the ray waits; *entry: for the list of those that do
ISO_INLINE int leave(const RayMarch *m, uint behind, global uint *ray_block_ids, uint *entry) {
  const int crosses = behind != ISO_INVALID_ID,
            waits = m->result == ISO_RAY_DOUBT || m->result == ISO_RAY_WAITS;
  uint log_ahead = m->entry.log_ahead;
  if (crosses) {
    log_ahead = ISO_BORDER_LOG_AHEAD;
    ray_block_ids[m->entry.pixel] = behind;
  } else if (waits && m->waits_at != m->stand.block_id) {
    log_ahead = further_ahead(log_ahead);
    ray_block_ids[m->entry.pixel] = m->waits_at;
  }
  *entry = pack_entry(m->entry.pixel, log_ahead, m->result == ISO_RAY_DOUBT ? 1u : 0u);
  return waits || crosses;
}

/// Does the ray end in this lane, without a hit, or leave its band?
ISO_INLINE int ends_without_hit(const RayMarch *m) {
  const int is_gone = m->is_gone && m->lane == 0;
  return ISO_BANDS ? leaves_band(m->result, is_gone) : is_gone || m->result == ISO_RAY_ENDS;
}

/// Walks rays on until they hit, leave or wait. A ray that leaves the band of its level waits
/// behind the border.
///
/// frame_params, frames, num_frames, clip, parts, given, ranges, no_data, no_data_begin  as
/// start_rays macrocell_masks                           as traverse In      active_ray_ids
/// [prev->next_active_count]; ray_block_ids [pixel]: the active block that a
///         ray goes on from
/// Out     hits [pixel]; next_active_ray_ids [counts->next_active_count] of the rays that wait, and
///         in ray_block_ids the block they wait at; *next_counts, opened; slot_stamps of the blocks
///         that were read
/// Launch  groups of ISO_GROUP_SIZE, which stride over the rays, in parts as start_rays
///
/// In rounds: find the next blocks, walk their cells. When rays are so few that a device would wait
/// for the longest of them, each has more work-items, up to one for each block of a round; the
/// first block in which anything happens decides, which an atomic_min of its place tells.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void march(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const ClipParams *clip, uint parts, global const GivenRay *given,
    global const uint *macrocell_masks, global const ushort *ranges, global const uint *no_data,
    uint no_data_begin, global const uint *table, global const ulong *inside,
    global ulong *changing, global const SlotValue *cache_values, global const PassCounts *prev,
    global PassCounts *counts, global PassCounts *next_counts, global const uint *active_ray_ids,
    global uint *next_active_ray_ids, global uint *ray_block_ids, global HitRecord *hits,
    global uint *slot_stamps, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  ISO_SCRATCH_ARRAY(slots, 8);
  ISO_SCRATCH_ARRAY(blocks, ISO_BLOCKS_AT_ONCE);
  local uint counters[2], group_hits, group_blocks, num_going;
  volatile local uint decides[ISO_GROUP_SIZE];
  const uint item = get_local_id(0), num_rays = prev->next_active_count;
  const uint lanes = lanes_per_ray(num_rays);
  const CacheReader reader = {
      .table = table,
      .inside = inside,
      .changing = changing,
      .values = cache_values,
      .slot_stamps = slot_stamps,
      .stamp = read_stamp(counts->pass),
      .slots = slots,
  };
  uint num_hits = 0, num_blocks = 0;
  if (get_global_id(0) == 0) {
    open_march(frame, prev, counts, next_counts, cache);
    counts->active_count = num_rays;
  }
  if (item == 0) counters[0] = group_hits = group_blocks = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < num_rays * lanes;
       begin += parts * get_global_size(0)) {
    RayMarch m = begin_march(active_ray_ids, ray_block_ids, hits, num_rays, (begin + item) / lanes,
                             item % lanes, lanes);
    const uint pixel = m.entry.pixel;
    ISO_FRAME_OF(level, m.stand.block_id);
    const LastPlanes last = last_planes(level);
    const Ray ray = ray_of(level, clip, given, pixel);
    m.blocks = blocks;
    m.decides = decides + item / lanes;
    for (int is_first = 1, more = 1; more != 0; is_first = 0) {
      m.num_passed = 0;
      if (m.lane == 0) *m.decides = ISO_INVALID_ID;
      if (item == 0) num_going = 0;
      barrier(CLK_LOCAL_MEM_FENCE);
      if (m.goes_on) {
        find_round(level, macrocell_masks, &ray, last, is_first, &m);
        walk_round(level, &reader, &ray, last, is_first, &m);
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      if (m.goes_on) {
        num_blocks += decide_round(&m);
        if (m.goes_on) atomic_inc(&num_going);
      }
      /* When all have read the place of their ray, one may store another. */
      barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
      more = num_going != 0;
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (m.result == ISO_RAY_HIT) {
      hits[pixel] = hit_of(level, clip, &ray, &m.change);
      ++num_hits;
      ++num_blocks;
    }
    if (ISO_BEHIND_HITS && ends_without_hit(&m)) hits[pixel] = no_hit();
    uint behind = ISO_INVALID_ID, entry;
    if (leaves_band(m.result, m.is_gone && m.lane == 0)) {
      behind = cross_borders(frames, num_frames, clip, macrocell_masks, ranges, no_data,
                             no_data_begin, pixel, level_of(frames, num_frames, m.stand.block_id),
                             leaves_on(m.result), m.blocks);
    }
    const int waits = leave(&m, behind, ray_block_ids, &entry);
    append_entry(waits, entry, counters, &counts->next_active_count, next_active_ray_ids);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  if (num_blocks != 0) atomic_add(&group_blocks, num_blocks);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
  if (item == 0 && group_blocks != 0) atomic_add(&counts->granted_count, group_blocks);
}
