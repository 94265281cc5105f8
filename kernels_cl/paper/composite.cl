/// composite.cl -- the closest of a ray's N_Spec results becomes its hit; the other rays go on
/// (Sec. 4.4).
#include "device/cached_cell.h"
#include "device/closest_pair.h"
#include "device/ray_pairs.h"
#include "portable/cell_intersect.h"
#include "portable/ray_state.h"

/// Ends the rays that hit.
///
/// Out     hits [pixel] if a ray hit; ray_block_ids [pixel] if it waits for a block without
///         slots; ray_active_mask [active_count]: 1 if it goes on; active_ray_ids: a ray that
///         moved on looks twice as far ahead
/// Launch  grid-stride over the active rays
kernel void composite(const FrameParams frame_params, global PassCounts *counts,
                      global uint *active_ray_ids, global const uint *pair_block_ids,
                      global const uint *pair_begins, global const PairHit *pair_hits,
                      global const uint *closest_pairs, global const uint *table,
                      global const SlotValue *cache_values, global uint *ray_block_ids,
                      global HitRecord *hits, global uint *ray_active_mask) {
  const FrameParams *frame = &frame_params;
  const LastPlanes last = last_planes(frame);
  const uint active_count = counts->active_count, spec_count = counts->spec_count,
             window = counts->window_count;
  for (uint a = get_global_id(0); a < active_count; a += get_global_size(0)) {
    const RayEntry entry = unpack_entry(active_ray_ids[a]);
    const uint ray_id = entry.pixel;
    uint goes_on =
        ray_block_ids[ray_id] != ISO_INVALID_ID; /* also for rays outside the window: untouched */
    if (a < window) {
      const uint begin = first_pair(frame, pair_begins, a, spec_count),
                 end = first_pair(frame, pair_begins, a + 1, spec_count);
      const uint pair = closest_pair(closest_pairs, pair_block_ids, pair_hits, a, begin, end);
      if (pair == ISO_INVALID_ID || (pair_hits[pair].cell == ISO_NOT_TESTED && pair != begin)) {
        if (frame->schedule.per_ray_speculation)
          active_ray_ids[a] = pack_entry(ray_id, further_ahead(entry.log_ahead), 0);
      }
      if (pair != ISO_INVALID_ID) {
        const uint block_id = pair_block_ids[pair];
        const PairHit pair_hit = pair_hits[pair];
        goes_on = pair_hit.cell == ISO_NOT_TESTED;
        if (goes_on) {
          ray_block_ids[ray_id] = block_id;
        } else {
          const Ray ray = make_ray(frame, ray_id);
          const BlockCoords b = block_coords(frame, block_id);
          const int x = (int)(4 * b.x + (pair_hit.cell & 3)),
                    y = (int)(4 * b.y + (pair_hit.cell >> 2 & 3)),
                    z = (int)(4 * b.z + (pair_hit.cell >> 4));
          const GridWalk cell = walk_from(&ray, x, y, z, 1, last);
          float w[8];
          load_corners(frame, table, cache_values, x, y, z, w);
          hits[ray_id] = make_hit(frame, &ray, w, x, y, z, region_entry(&ray, x, y, z, 1, last),
                                  walk_exit(&cell, &ray), pair_hit.s);
          atomic_inc(&counts->hit_count);
        }
      }
    }
    ray_active_mask[a] = goes_on;
  }
}
