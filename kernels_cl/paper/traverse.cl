/// traverse.cl -- each active ray's next N_Spec blocks that may hold the isosurface
/// (Sec. 3.3, 4.1).
///
///   traverse                                           every ray has N_Spec places
///   traverse_count -> traverse_share -> traverse_tiles -> scan_exclusive -> traverse_begins
///     -> traverse_scanned                              places that rays leave go to others
///
/// The latter is what the paper leaves open, and other places for the same pairs (ray_pairs.h). A
/// ray with fewer blocks before it than N_Spec takes just these, so that N_Spec can be larger: as
/// large as the places of all allow.
#define ISO_FOUND global
#include "device/block_walk.h"
#include "device/work_group.h"
#include "portable/ray_state.h"
#include "portable/window.h"

/// Finds the next active blocks of each ray: N_Spec at most, fewer if a ray has its own number
/// (frame->schedule.per_ray_speculation).
///
/// macrocell_masks  [2 * coarse cells] bit x + 4y + 16z of a block in its coarse cell
/// In               active_ray_ids [window_count]; ray_block_ids [pixel]: the block to go on from
/// Out              pair_block_ids [window_count * spec_count]: entries a * spec_count + k, k
///                  ascending along the ray, ISO_INVALID_ID behind the last; ray_block_ids [pixel]:
///                  the first block not yet looked at, or ISO_INVALID_ID when the ray has left the
///                  volume; closest_pairs [window_count]: ISO_INVALID_ID
/// Launch           grid-stride over the window, in `parts` launches (ocl::Range)
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse(
    const FrameParams frame_params, uint parts, global const uint *macrocell_masks,
    global PassCounts *counts, global const uint *active_ray_ids, global uint *ray_block_ids,
    global uint *pair_block_ids, global uint *closest_pairs) {
  const FrameParams *frame = &frame_params;
  local uint group_pairs, group_ahead;
  const uint window = counts->window_count, spec_count = counts->spec_count;
  uint pairs = 0, sum_ahead = 0;
  if (get_local_id(0) == 0) group_pairs = group_ahead = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint a = get_global_id(0); a < window; a += parts * get_global_size(0)) {
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

#ifndef ISO_SCANNED_PAIRS   /* by -D */
#define ISO_SCANNED_PAIRS 1 /* 0: what follows is not wanted, and not compiled */
#endif
#if ISO_SCANNED_PAIRS

#define ISO_COUNTED_PART 4u  ///< rays count up to so many times the N_Spec that all can have

/// spec_count: speculation_count().
ISO_INLINE uint most_counted(const FrameParams *frame, uint spec_count) {
  return min(frame->schedule.max_spec_count, ISO_COUNTED_PART * spec_count);
}

/// Counts the active blocks before each ray.
///
/// In      counts->spec_count: N_Spec if every ray had as many places
/// Out     closest_pairs [window_count]: how many there are, at most most_counted();
///         histogram [ISO_MAX_SPECULATION + 1]: how many rays have so many; pair_block_ids
///         [window_count]: nothing of use
/// Launch  grid-stride over the window, in `parts` launches (ocl::Range)
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse_count(
    const FrameParams frame_params, uint parts, global const uint *macrocell_masks,
    global const PassCounts *counts, global const uint *active_ray_ids,
    global const uint *ray_block_ids, global uint *pair_block_ids, global uint *closest_pairs,
    global uint *histogram) {
  const FrameParams *frame = &frame_params;
  local uint of_group[ISO_MAX_SPECULATION + 1];
  const uint window = counts->window_count, most = most_counted(frame, counts->spec_count);
  for (uint i = get_local_id(0); i <= ISO_MAX_SPECULATION; i += ISO_GROUP_SIZE) of_group[i] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint a = get_global_id(0); a < window; a += parts * get_global_size(0)) {
    const uint ray_id = unpack_entry(active_ray_ids[a]).pixel;
    const Ray ray = make_ray(frame, ray_id);
    uint block_id = ray_block_ids[ray_id];
    const uint found =
        find_blocks(frame, macrocell_masks, &ray, &block_id, most, pair_block_ids + a, 0);
    closest_pairs[a] = found;
    atomic_inc(&of_group[found]);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = get_local_id(0); i <= ISO_MAX_SPECULATION; i += ISO_GROUP_SIZE) {
    if (of_group[i] != 0) atomic_add(&histogram[i], of_group[i]);
  }
}

/// N_Spec becomes the most with which all rays together have places enough. Not less than before:
/// so many have a place each.
///
/// Out     counts->spec_count; histogram: 0 again
/// Launch  one work-item
kernel void traverse_share(const FrameParams frame_params, global PassCounts *counts,
                           global uint *histogram) {
  const FrameParams *frame = &frame_params;
  const uint before = counts->spec_count, window = counts->window_count;
  /* While only some rays take part, slots of the cache are what lacks, not places. */
  const uint places = window < counts->active_count ? window * before : frame_rays(frame);
  uint with_more = window, taken = 0, spec_count = before;
  for (uint n = 1; n <= most_counted(frame, before); ++n) {
    with_more -= histogram[n - 1]; /* rays with n blocks and more */
    taken += with_more;
    if (taken <= places && n > spec_count) spec_count = n;
  }
  for (uint n = 0; n <= ISO_MAX_SPECULATION; ++n) histogram[n] = 0;
  counts->spec_count = spec_count;
}

#define RAY_TILE (ISO_GROUP_SIZE * ISO_SCAN_ITEMS)

/// Out     tile_sums [tiles of the window]: places that their rays take
/// Launch  groups stride over tiles
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse_tiles(
    global const PassCounts *counts, global const uint *num_blocks, global uint *tile_sums) {
  local uint sums[ISO_GROUP_SIZE];
  const uint window = counts->window_count, spec_count = counts->spec_count;
  for (uint tile = get_group_id(0); tile * RAY_TILE < window; tile += get_num_groups(0)) {
    uint sum = 0, total;
    for (uint i = 0; i < ISO_SCAN_ITEMS; ++i) {
      const uint a = tile * RAY_TILE + i * ISO_GROUP_SIZE + get_local_id(0);
      sum += a < window ? min(num_blocks[a], spec_count) : 0;
    }
    group_scan(sums, sum, &total);
    if (get_local_id(0) == 0) tile_sums[tile] = total;
  }
}

/// In      tile_offsets: the scanned tile_sums; counts->pair_slot_count: their sum
/// Out     pair_begins [window_count + 1]
/// Launch  groups stride over tiles
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse_begins(
    global const PassCounts *counts, global const uint *num_blocks, global const uint *tile_offsets,
    global uint *pair_begins) {
  local uint sums[ISO_GROUP_SIZE];
  const uint window = counts->window_count, spec_count = counts->spec_count;
  for (uint tile = get_group_id(0); tile * RAY_TILE < window; tile += get_num_groups(0)) {
    const uint first = tile * RAY_TILE + get_local_id(0) * ISO_SCAN_ITEMS,
               end = min(first + ISO_SCAN_ITEMS, window);
    uint sum = 0, total, begin;
    for (uint a = first; a < end; ++a) sum += min(num_blocks[a], spec_count);
    begin = tile_offsets[tile] + group_scan(sums, sum, &total);
    for (uint a = first; a < end; ++a) {
      pair_begins[a] = begin;
      begin += min(num_blocks[a], spec_count);
    }
  }
  if (get_global_id(0) == 0) pair_begins[window] = counts->pair_slot_count;
}

/// Finds the next active blocks of each ray, as many as it has places. A ray that has had fewer
/// before it than it could count is then through.
///
/// In      pair_begins [window_count + 1]; closest_pairs, as traverse_count leaves them
/// Out     as traverse; pair_rays [pair_slot_count]
/// Launch  grid-stride over the window, in `parts` launches (ocl::Range)
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse_scanned(
    const FrameParams frame_params, uint parts, global const uint *macrocell_masks,
    global PassCounts *counts, global const uint *active_ray_ids, global const uint *pair_begins,
    global uint *pair_rays, global uint *ray_block_ids, global uint *pair_block_ids,
    global uint *closest_pairs) {
  const FrameParams *frame = &frame_params;
  const uint window = counts->window_count, spec_count = counts->spec_count,
             most = most_counted(frame, speculation_count(frame, counts->active_count));
  if (get_global_id(0) == 0) {
    counts->pair_count = counts->pair_slot_count;
    counts->ahead_count = window * spec_count;
  }
  for (uint a = get_global_id(0); a < window; a += parts * get_global_size(0)) {
    const uint ray_id = unpack_entry(active_ray_ids[a]).pixel, begin = pair_begins[a],
               wanted = pair_begins[a + 1] - begin, num_blocks = closest_pairs[a];
    uint block_id = ISO_INVALID_ID;
    if (wanted != 0) {
      const Ray ray = make_ray(frame, ray_id);
      block_id = ray_block_ids[ray_id];
      find_blocks(frame, macrocell_masks, &ray, &block_id, wanted, pair_block_ids + begin, 1);
    }
    for (uint k = 0; k < wanted; ++k) pair_rays[begin + k] = a;
    ray_block_ids[ray_id] = wanted == num_blocks && num_blocks < most ? ISO_INVALID_ID : block_id;
    closest_pairs[a] = ISO_INVALID_ID;
  }
}

#endif
