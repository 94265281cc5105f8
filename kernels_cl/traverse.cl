/// traverse.cl -- each active ray's next N_Spec blocks that may hold the isosurface
/// (Sec. 3.3, 4.1).
#define ISO_FOUND global
#include "device/block_walk.h"

/// Finds the next active blocks of each ray: N_Spec at most, fewer where a ray has its own number
/// (frame->schedule.per_ray_speculation).
///
/// macrocell_masks  [2 * coarse cells] bit x + 4y + 16z of a block in its coarse cell
/// In               active_ray_ids [window_count]; ray_block_ids [pixel]: the block to go on from
/// Out              pair_block_ids [window_count * spec_count]: entries a * spec_count + k, k
///                  ascending along the ray, ISO_INVALID_ID behind the last; ray_block_ids [pixel]:
///                  the first block not yet looked at, or ISO_INVALID_ID when the ray has left the
///                  volume; closest_pairs [window_count]: ISO_INVALID_ID
/// Launch           grid-stride over the window
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse(
    const FrameParams frame_params, global const uint *macrocell_masks, global PassCounts *counts,
    global const uint *active_ray_ids, global uint *ray_block_ids, global uint *pair_block_ids,
    global uint *closest_pairs) {
  const FrameParams *frame = &frame_params;
  local uint group_pairs, group_ahead;
  const uint window = counts->window_count, spec_count = counts->spec_count;
  uint pairs = 0, sum_ahead = 0;
  if (get_local_id(0) == 0) group_pairs = group_ahead = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint a = get_global_id(0); a < window; a += get_global_size(0)) {
    const RayEntry entry = unpack_entry(active_ray_ids[a]);
    const uint ray_id = entry.pixel;
    const uint ahead =
        frame->schedule.per_ray_speculation ? min(own_ahead(entry), spec_count) : spec_count;
    const Ray ray = make_ray(frame, ray_id);
    uint block_id = ray_block_ids[ray_id];
    const uint found = find_blocks(frame, macrocell_masks, &ray, &block_id, ahead,
                                   pair_block_ids + a * spec_count, 1);
    for (uint k = found; k < spec_count; ++k) pair_block_ids[a * spec_count + k] = ISO_INVALID_ID;
    ray_block_ids[ray_id] = block_id;
    closest_pairs[a] = ISO_INVALID_ID;
    pairs += found;
    sum_ahead += ahead;
  }
  if (pairs != 0) atomic_add(&group_pairs, pairs);
  if (sum_ahead != 0) atomic_add(&group_ahead, sum_ahead);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && group_pairs != 0) atomic_add(&counts->pair_count, group_pairs);
  if (get_local_id(0) == 0 && group_ahead != 0) atomic_add(&counts->ahead_count, group_ahead);
}
