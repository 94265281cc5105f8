/// request_ahead.cl -- pipeline `rays`: each ray that waits asks for the block that it stands at
/// and its next candidates (Sec. 3.3, 3.4, 4).
#include "device/level_borders.h"
#include "device/ray_lanes.h"
#include "device/ray_source.h"
#include "device/touched_requests.h"
#include "portable/touched_blocks.h"
#include "portable/window.h"

/// Asks for those of the given corners of the dual grid of block b that are not cached; stamps the
/// others. In steps for all corners, so that a GPU waits for memory twice, not sixteen times.
ISO_INLINE void request_touched(const FrameParams *frame, global const uint *table,
                                global uint *slot_stamps, uint stamp, BlockCoords b, uint touched,
                                Requests requests) {
  uint slots[8];
  uint missing = unasked_corners(frame, b, touched, requests);
  if (missing == 0) return;
  find_dual_grid(frame, table, b.x, b.y, b.z, slots);
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    if ((missing >> corner & 1u) != 0 && slots[corner] != ISO_BLOCK_ABSENT) {
      slot_stamps[slots[corner]] = stamp;
      missing &= ~(1u << corner);
    }
  }
  request_corners(frame, b, missing, requests);
}

#ifdef ISO_CPU
#define ISO_LOOKS_FIRST 1
#else
#define ISO_LOOKS_FIRST 0
#endif

/// Corners (bits 0..7) of the 2^3 blocks from b on that there are in the volume.
ISO_INLINE uint existing_corners(const FrameParams *frame, BlockCoords b) {
  return (b.x + 1 < frame->grid.blocks_x ? 0xFFu : 0x55u) &
         (b.y + 1 < frame->grid.blocks_y ? 0xFFu : 0x33u) &
         (b.z + 1 < frame->grid.blocks_z ? 0xFFu : 0x0Fu);
}

/// Requests blocks: the first counts->window_count rays that wait ask for the blocks that they
/// touch in their next active blocks: N_Spec of them (Sec. 4), or, with
/// frame->schedule.per_ray_speculation, a number of their own.
///
/// In      active_ray_ids [counts->next_active_count]; the other arguments as in march
/// Out     request_block_ids [counts->requested_count, at most capacity]; slot_stamps of those of
///         the blocks that are cached
/// Launch  groups of ISO_GROUP_SIZE, which stride over the rays; when these are few, each has more
///         work-items, which share its blocks out among them
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void request_ahead(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const ClipParams *clip, global const GivenRay *given, global const uint *macrocell_masks,
    global const uint *table, global PassCounts *counts, global const uint *active_ray_ids,
    global const uint *ray_block_ids, global uint *slot_stamps, global uint *requested_bits,
    global uint *request_block_ids, uint capacity, global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  ISO_SCRATCH_ARRAY(found, ISO_BLOCKS_AT_ONCE);
  local uint staged[ISO_REQUEST_STAGING];
  local uint num_staged, list_begin, group_pairs, group_ahead;
  const Requests requests = {requested_bits, request_block_ids, capacity, &counts->requested_count,
                             staged,         &num_staged};
  const uint item = get_local_id(0), num_waiting = counts->next_active_count;
  const uint num_rays = rays_in_window(counts->window_count, num_waiting);
  const uint lanes = lanes_per_ray(num_rays);
  const uint stamp = needed_stamp(counts->pass);
  const uint spec_count = speculation_count(frame, num_waiting);
  /* If rays are few, all look further: the last ones take fewer passes, and decode hardly more.
     With the number of those that wait, which is fewer, decoding takes longer than the passes that
     it saves. */
  const uint least = speculation_count(frame, counts->active_count) / 2;
  const uint most = most_ahead(frame, counts->window_count, num_rays);
  uint num_pairs = 0, num_ahead = 0;
  if (get_global_id(0) == 0) counts->spec_count = spec_count;
  if (item == 0) num_staged = group_pairs = group_ahead = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_rays * lanes;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint i = (begin + item) / lanes, lane = (begin + item) % lanes;
    if (i < num_rays) {
      const RayEntry entry = unpack_entry(active_ray_ids[i]);
      /* The ray stands at an active block, or has a side. */
      const RayStand stand = read_stand(ray_block_ids[entry.pixel]);
      uint next = stand.block_id, side = stand.side;
      ISO_FRAME_OF(level, next);
      const LastPlanes last = last_planes(level);
      const Ray ray = ray_of(level, clip, given, entry.pixel);
      const uint own = min(own_ahead(entry), frame->schedule.max_spec_count);
      const uint ahead =
          min(frame->schedule.per_ray_speculation ? max(own, least) : spec_count, most);
      if (lane == 0) num_ahead += ahead;
      for (uint asked = 0; asked < ahead && next != ISO_INVALID_ID;) {
        const uint num_found = find_blocks_from(level, macrocell_masks, &ray, side, &next,
                                                min(ahead - asked, ISO_BLOCKS_AT_ONCE), found);
        side = ISO_SIDE_UNKNOWN;
        for (uint at = lane; at < num_found; at += lanes) { /* all lanes at once */
          const uint block_id = found[at * ISO_SCRATCH_STRIDE];
          const BlockCoords b = block_coords(level, block_id);
          const int is_first = i == 0 && asked + at == 0;
          ++num_pairs;
          /* A CPU sees faster that all of them have been asked for than which the ray touches. */
          if (!ISO_LOOKS_FIRST || is_first ||
              unasked_corners(level, b, existing_corners(level, b), requests) != 0) {
            const uint touched = touched_blocks(&ray, (int)b.x, (int)b.y, (int)b.z, last);
            request_touched(level, table, slot_stamps, stamp, b, touched, requests);
            if (is_first) {
              cache->first_block_id = block_id;
              cache->first_touched = touched;
            }
          }
        }
        asked += num_found;
      }
    }
    list_staged(frame, requests, &list_begin);
  }
  if (num_pairs != 0) atomic_add(&group_pairs, num_pairs);
  if (num_ahead != 0) atomic_add(&group_ahead, num_ahead);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_pairs != 0) atomic_add(&counts->pair_count, group_pairs);
  if (item == 0 && group_ahead != 0) atomic_add(&counts->ahead_count, group_ahead);
}
