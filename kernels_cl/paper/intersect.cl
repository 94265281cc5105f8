/// intersect.cl -- a block's rays against its dual grid (Sec. 3.7, 4.3).
#include "device/cached_cell.h"
#include "device/closest_pair.h"
#include "device/ray_pairs.h"
#include "portable/block_cells.h"
#include "portable/cell_intersect.h"
#include "portable/ray_state.h"

/// The first change of inside in the cells of block b, or ISO_IN_DOUBT + the cell at which the walk
/// came into doubt. dual_grid [125]: vertex x + 5y + 25z minus the isovalue.
ISO_INLINE PairHit intersect_block(const Ray *ray, BlockCoords b, LastPlanes last,
                                   local const float *dual_grid) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  CellWalk at = enter_cells(ray, b, region_entry(ray, (int)b.x, (int)b.y, (int)b.z, 4, last), last);
  CellChange change;
  PairHit hit;
  int found;
  do {
    const int vertex = (at.cell.x & 3) + 5 * (at.cell.y & 3) + 25 * (at.cell.z & 3);
    float w[8];
    for (int corner = 0; corner < 8; ++corner) {
      w[corner] = dual_grid[vertex + (corner & 1) + 5 * (corner >> 1 & 1) + 25 * (corner >> 2)];
    }
    found = change_or_doubt_in_cell(solver, ray, w, at.cell.x, at.cell.y, at.cell.z, at.enter,
                                    at.exit, &change);
  } while (!found && next_cell(&at, ray, last));
  hit.cell = !found                  ? ISO_NO_HIT
             : found == ISO_DOUBTFUL ? ISO_IN_DOUBT + cell_in_block(&at.cell)
                                     : cell_in_block(&at.cell);
  hit.s = hit.cell < ISO_NO_HIT ? refine(solver, change.cubic, change.bracket) : 0.0f;
  return hit;
}

/// Intersects the rays of each block with its cells.
///
/// In      pair_ids [granted_count]: pairs gathered by their block; block_rays [visible_count]:
///         which of them are a block's; pair_block_ids [pair slots]
/// Out     pair_hits [pair slots], written for every pair; closest_pairs [active rays]: see
///         closest_pair.h
/// Launch  a work-group per visible block, striding over them, in `parts` launches (ocl::Range)
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void intersect(
    const FrameParams frame_params, uint parts, global const PassCounts *counts,
    global const uint *pair_ids, global const BlockRays *block_rays,
    global const uint *pair_block_ids, global const uint *table,
    global const SlotValue *cache_values, global const uint *active_ray_ids,
    global const uint *pair_rays, global PairHit *pair_hits, global uint *closest_pairs) {
  const FrameParams *frame = &frame_params;
  local float dual_grid[ISO_DUAL_GRID_VERTICES];
  local uint corner_slots[8];
  const LastPlanes last = last_planes(frame);
  const uint visible_count = counts->visible_count, spec_count = counts->spec_count;
  for (uint visible = get_global_id(0) / ISO_GROUP_SIZE; visible < visible_count;
       visible += parts * get_num_groups(0)) {
    const uint begin = block_rays[visible].begin, end = block_rays[visible].end;
    const BlockCoords b = block_coords(frame, pair_block_ids[pair_ids[begin]]);
    for (uint corner = get_local_id(0); corner < 8; corner += ISO_GROUP_SIZE) {
      corner_slots[corner] = dual_grid_block(frame, b, corner) == ISO_INVALID_ID
                                 ? ISO_BLOCK_ABSENT
                                 : cached_slot(frame, table, b.x + (corner & 1),
                                               b.y + (corner >> 1 & 1), b.z + (corner >> 2));
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint vertex = get_local_id(0); vertex < ISO_DUAL_GRID_VERTICES; vertex += ISO_GROUP_SIZE) {
      const uint x = vertex % 5, y = vertex / 5 % 5, z = vertex / 25;
      const uint slot = corner_slots[(x >> 2) + 2 * (y >> 2) + 4 * (z >> 2)];
      float value = 0.0f; /* beyond the volume: no cell of the block uses it */
      if (slot != ISO_BLOCK_ABSENT) {
        value = cache_values[slot * ISO_BLOCK_VOXELS + (x & 3) + 4 * (y & 3) + 16 * (z & 3)] -
                frame->surface.isovalue;
      }
      dual_grid[vertex] = value;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = begin + get_local_id(0); i < end; i += ISO_GROUP_SIZE) {
      const uint pair = pair_ids[i], a = ray_of_pair(frame, pair_rays, pair, spec_count);
      const Ray ray = make_ray(frame, unpack_entry(active_ray_ids[a]).pixel);
      const PairHit hit = intersect_block(&ray, b, last, dual_grid);
      pair_hits[pair] = hit;
      if (hit.cell < ISO_NO_HIT) offer_closest(closest_pairs, a, pair);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}

/// The pairs whose walk came into doubt, walked on from there with 48-bit arithmetic. They are few,
/// but in intersect() the registers for them would cost a fifth of its speed (H100).
///
/// In      as intersect, without block_rays
/// Out     pair_hits and closest_pairs of those pairs
/// Launch  grid-stride over the pairs, in `parts` launches (ocl::Range)
kernel void settle_doubts(const FrameParams frame_params, uint parts,
                          global const PassCounts *counts, global const uint *pair_ids,
                          global const uint *pair_block_ids, global const uint *table,
                          global const SlotValue *cache_values, global const uint *active_ray_ids,
                          global const uint *pair_rays, global PairHit *pair_hits,
                          global uint *closest_pairs) {
  const FrameParams *frame = &frame_params;
  const LastPlanes last = last_planes(frame);
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  for (uint i = get_global_id(0); i < counts->granted_count; i += parts * get_global_size(0)) {
    const uint pair = pair_ids[i], start = pair_hits[pair].cell;
    if (start >= ISO_IN_DOUBT) {
      const uint a = ray_of_pair(frame, pair_rays, pair, counts->spec_count);
      const Ray ray = make_ray(frame, unpack_entry(active_ray_ids[a]).pixel);
      const BlockCoords b = block_coords(frame, pair_block_ids[pair]);
      const int x = (int)(4 * b.x + (start & 3)), y = (int)(4 * b.y + (start >> 2 & 3)),
                z = (int)(4 * b.z + (start >> 4 & 3));
      CellWalk at = start_at_cell(&ray, x, y, z, region_entry(&ray, x, y, z, 1, last), last);
      CellChange change;
      PairHit hit;
      int found;
      do {
        float w[8];
        load_corners(frame, table, cache_values, at.cell.x, at.cell.y, at.cell.z, w);
        found = change_in_cell(solver, &ray, w, at.cell.x, at.cell.y, at.cell.z, at.enter, at.exit,
                               &change);
      } while (!found && next_cell(&at, &ray, last));
      hit.cell = found ? cell_in_block(&at.cell) : ISO_NO_HIT;
      hit.s = found ? refine(solver, change.cubic, change.bracket) : 0.0f;
      pair_hits[pair] = hit;
      if (hit.cell < ISO_NO_HIT) offer_closest(closest_pairs, a, pair);
    }
  }
}
