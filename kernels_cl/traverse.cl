/// traverse.cl -- each active ray's next N_Spec blocks that may hold the isosurface (Sec. 3.3, 4.1).
/// Two-level grid: a coarse macrocell is 4^3 blocks; its 64 bits say which of them the isovalue is in the
/// range of (macrocells.cl). A coarse cell with no bit is left in one step.
#include "block_grid.h"
#include "grid_dda.h"

/// The block of coarse macrocell (cx,cy,cz) that the ray is in just after event `e`, by which it entered the cell.
inline GridWalk enter_macrocell(const Ray *ray, const GridWalk *coarse, RayEvent e, LastPlanes last) {
  const int bx = coarse->x * ISO_MACROCELL_BLOCKS, by = coarse->y * ISO_MACROCELL_BLOCKS,
            bz = coarse->z * ISO_MACROCELL_BLOCKS;
  const int x = locate(ray->x, 0, e, 4, bx, min(bx + ISO_MACROCELL_BLOCKS - 1, (last.x - 1) / 4));
  const int y = locate(ray->y, 1, e, 4, by, min(by + ISO_MACROCELL_BLOCKS - 1, (last.y - 1) / 4));
  const int z = locate(ray->z, 2, e, 4, bz, min(bz + ISO_MACROCELL_BLOCKS - 1, (last.z - 1) / 4));
  return walk_from(ray, x, y, z, 4, last);
}

/// Walks on from block *block_id to the next `wanted` blocks that have their bit, into found. Returns how many there are
/// before the ray leaves the volume; *block_id becomes the first block not looked at, or ISO_INVALID_ID.
inline uint find_blocks(constant FrameParams *frame, global const uint *macrocell_masks, const Ray *ray,
                        uint *block_id, uint wanted, global uint *found) {
  const LastPlanes last = last_planes(frame);
  const int end_x = (last.x - 1) / 4 + 1, end_y = (last.y - 1) / 4 + 1, end_z = (last.z - 1) / 4 + 1;
  const uint coarse_x = (frame->blocks_x + 3) / 4, coarse_y = (frame->blocks_y + 3) / 4;
  const BlockCoords from = block_coords(frame, *block_id);
  /* The outer walk steps from coarse cell to coarse cell; only in those with a bit is there an inner one. */
  GridWalk w = walk_from(ray, (int)from.x, (int)from.y, (int)from.z, 4, last);
  GridWalk coarse = walk_from(ray, w.x / ISO_MACROCELL_BLOCKS, w.y / ISO_MACROCELL_BLOCKS,
                              w.z / ISO_MACROCELL_BLOCKS, 4 * ISO_MACROCELL_BLOCKS, last);
  RayEvent entry = start_event();
  int within = 1, entered = 1; /* entered: w is in this coarse cell */
  uint k = 0;
  while (within && k < wanted) {
    const uint cell = (uint)coarse.x + coarse_x * ((uint)coarse.y + coarse_y * (uint)coarse.z);
    const uint low = macrocell_masks[2 * cell], high = macrocell_masks[2 * cell + 1];
    if ((low | high) != 0) {
      if (!entered) w = enter_macrocell(ray, &coarse, entry, last);
      entered = 1;
      while (entered && within && k < wanted) {
        const uint bit = (uint)((w.x & 3) + 4 * (w.y & 3) + 16 * (w.z & 3));
        if ((bit < 32 ? low >> bit : high >> (bit - 32)) & 1u) {
          found[k++] = block_id_at(frame, (uint)w.x, (uint)w.y, (uint)w.z);
        }
        walk_step(&w, ray, walk_exit(&w), 4, last);
        within = w.x >= 0 && w.x < end_x && w.y >= 0 && w.y < end_y && w.z >= 0 && w.z < end_z;
        entered = w.x >> 2 == coarse.x && w.y >> 2 == coarse.y && w.z >> 2 == coarse.z;
      }
    }
    if (k < wanted) {
      entry = walk_exit(&coarse);
      walk_step(&coarse, ray, entry, 4 * ISO_MACROCELL_BLOCKS, last);
      within = coarse.x >= 0 && 4 * coarse.x < end_x && coarse.y >= 0 && 4 * coarse.y < end_y &&
               coarse.z >= 0 && 4 * coarse.z < end_z;
      entered = 0;
    }
  }
  *block_id = within ? block_id_at(frame, (uint)w.x, (uint)w.y, (uint)w.z) : ISO_INVALID_ID;
  return k;
}

/// pair_block_ids [active_count * spec_count]: entries a * spec_count + k, k ascending along the ray; ISO_INVALID_ID behind
/// the last. ray_block_ids [pixel]: in, the block to go on from; out, the first block not yet looked at, or
/// ISO_INVALID_ID when the ray has left the volume. macrocell_masks [2 * coarse cells]: bit x + 4y + 16z of a block in its
/// coarse cell. Grid-stride over active rays.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse(
    constant FrameParams *frame, global const uint *macrocell_masks, global PassCounts *counts,
    global const uint *active_ray_ids, global uint *ray_block_ids, global uint *pair_block_ids) {
  local uint group_pairs;
  const uint active_count = counts->active_count, spec_count = counts->spec_count;
  uint pairs = 0;
  if (get_local_id(0) == 0) group_pairs = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint a = get_global_id(0); a < active_count; a += get_global_size(0)) {
    const uint ray_id = active_ray_ids[a];
    const Ray ray = make_ray(frame, ray_id);
    uint block_id = ray_block_ids[ray_id];
    const uint found =
        find_blocks(frame, macrocell_masks, &ray, &block_id, spec_count, pair_block_ids + a * spec_count);
    for (uint k = found; k < spec_count; ++k) pair_block_ids[a * spec_count + k] = ISO_INVALID_ID;
    ray_block_ids[ray_id] = block_id;
    pairs += found;
  }
  if (pairs != 0) atomic_add(&group_pairs, pairs);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && group_pairs != 0) atomic_add(&counts->pair_count, group_pairs);
}
