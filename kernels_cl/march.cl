/// march.cl -- pipeline `rays`: each ray walks through the active blocks and intersects those that
/// are cached, until it hits, leaves, or comes to one that is not: there it waits (Sec. 3.3, 3.7).
///
/// start_rays -> march -> request_ahead -> [ cache -> decode -> march -> request_ahead ]*. No sort
/// and no composite: a ray's blocks come in ray order, so its first change is its hit.
#define ISO_FOUND local
#include "device/level_borders.h"
#include "device/march_block.h"
#include "device/march_pass.h"
#include "device/ray_lanes.h"
#include "device/ray_source.h"
#include "device/work_group.h"

/// Walks rays on until they hit, leave or wait. A ray that leaves the band of its level waits
/// behind the border.
///
/// frame_params, frames, num_frames, parts, given, ranges, no_data, no_data_begin  as start_rays
/// macrocell_masks                           as traverse
/// In      active_ray_ids [prev->next_active_count]; ray_block_ids [pixel]: the active block that a
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
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames, uint parts,
    global const GivenRay *given, global const uint *macrocell_masks, global const ushort *ranges,
    global const uint *no_data, uint no_data_begin, global BlockEntry *table,
    global const ulong *inside, global const float *cache_values, global const PassCounts *prev,
    global PassCounts *counts, global PassCounts *next_counts, global const uint *active_ray_ids,
    global uint *next_active_ray_ids, global uint *ray_block_ids, global HitRecord *hits,
    global uint *slot_stamps, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  local uint slots[8 * ISO_GROUP_SIZE], found[ISO_BLOCKS_AT_ONCE * ISO_GROUP_SIZE];
  local uint counters[2], group_hits, group_blocks, num_going;
  volatile local uint deciding[ISO_GROUP_SIZE]; /* of each ray's blocks of the round */
  const uint item = get_local_id(0), num_rays = prev->next_active_count;
  const uint lanes = lanes_per_ray(num_rays);
  const uint stamp = read_stamp(counts->pass);
  uint num_hits = 0, num_blocks = 0;
  if (get_global_id(0) == 0) {
    open_march(frame, prev, counts, next_counts, cache);
    counts->active_count = num_rays;
  }
  if (item == 0) counters[0] = group_hits = group_blocks = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_global_id(0) - item; begin < num_rays * lanes;
       begin += parts * get_global_size(0)) {
    const uint i = (begin + item) / lanes, lane = item % lanes;
    const int is_ray = i < num_rays;
    const RayEntry entry = unpack_entry(is_ray ? active_ray_ids[i] : 0);
    const uint pixel = entry.pixel;
    const RayStand stand = read_stand(is_ray ? ray_block_ids[pixel] : ISO_INVALID_ID);
    const uint from = stand.block_id;
    ISO_FRAME_OF(level, from);
    const LastPlanes last = last_planes(level);
    const Ray ray = ray_of(level, given, pixel);
    uint next = from, at = lane, more = 1, waits_at = 0, decides_at = 0;
    int result = ISO_RAY_LEFT, going = is_ray, gone = 0, first = 1;
    BlockChange change;
    while (more != 0) {
      uint num_passed = 0;
      if (lane == 0) deciding[item / lanes] = ISO_INVALID_ID;
      if (item == 0) num_going = 0;
      barrier(CLK_LOCAL_MEM_FENCE);
      if (going) {
        uint num_found = 1;
        if (first && lanes == 1) { /* most rays of a cold frame wait right there */
          found[item] = from;
          next = block_behind(level, &ray, block_coords(level, from), last);
        } else {
          num_found =
              find_blocks_from(level, macrocell_masks, &ray, first ? stand.side : ISO_SIDE_UNKNOWN,
                               &next, ISO_BLOCKS_AT_ONCE, found + item);
        }
        for (at = lane; at < num_found && result == ISO_RAY_LEFT; at += lanes) {
          const int stands_here = first && at == 0;
          const int may_end = next == ISO_INVALID_ID && at + 1 == num_found;
          result = march_block(level, table, inside, cache_values, &ray,
                               block_coords(level, found[at * ISO_GROUP_SIZE + item]), last,
                               slots + item, slot_stamps, stamp, stands_here && entry.in_doubt != 0,
                               stands_here ? stand.side : ISO_SIDE_UNKNOWN, may_end, &change);
          if (result == ISO_RAY_LEFT) {
            ++num_passed;
          } else {
            atomic_min(&deciding[item / lanes], at);
            decides_at = at;
            waits_at = found[at * ISO_GROUP_SIZE + item];
          }
        }
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      if (going) {
        const uint place = deciding[item / lanes];
        if (lane < place) num_blocks += min(num_passed, (place - lane - 1) / lanes + 1);
        if (decides_at != place) result = ISO_RAY_LEFT;
        going = place == ISO_INVALID_ID && next != ISO_INVALID_ID;
        gone = place == ISO_INVALID_ID && next == ISO_INVALID_ID;
        if (going) atomic_inc(&num_going);
      }
      first = 0;
      barrier(CLK_LOCAL_MEM_FENCE |
              CLK_GLOBAL_MEM_FENCE); /* all know where their ray stood: one may say where it is */
      more = num_going;
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (result == ISO_RAY_HIT) {
      hits[pixel] = hit_of(level, &ray, &change);
      ++num_hits;
      ++num_blocks;
    }
    int waits = result == ISO_RAY_DOUBT || result == ISO_RAY_WAITS;
    uint log_ahead = entry.log_ahead;
    if (waits && waits_at != from) {
      log_ahead = further_ahead(log_ahead);
      ray_block_ids[pixel] = waits_at;
    }
    if (leaves_band(result, gone && lane == 0)) {
      const uint behind =
          cross_borders(frames, num_frames, macrocell_masks, ranges, no_data, no_data_begin, pixel,
                        level_of(frames, num_frames, from), leaves_on(result), found + item);
      waits = behind != ISO_INVALID_ID;
      if (waits) ray_block_ids[pixel] = behind;
      log_ahead = ISO_BORDER_LOG_AHEAD;
    }
    append_entry(waits, pack_entry(pixel, log_ahead, result == ISO_RAY_DOUBT ? 1u : 0u), counters,
                 &counts->next_active_count, next_active_ray_ids);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  if (num_blocks != 0) atomic_add(&group_blocks, num_blocks);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
  if (item == 0 && group_blocks != 0) atomic_add(&counts->granted_count, group_blocks);
}
