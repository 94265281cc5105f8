/// traverse.cl -- each active ray's next N_Spec blocks that may hold the isosurface (Sec. 3.3, 4.1).
/// Two-level grid: a coarse macrocell is 4^3 blocks; its 64 bits say which of them the isovalue is in the
/// range of (macrocells.cl). A coarse cell with no bit is left in one step.
#include "block_grid.h"
#include "grid_dda.h"

/// Leaves the coarse macrocell that the walk's block is in: the walk goes on in the first block behind it.
inline GridWalk leave_macrocell(const GridWalk *w, const Ray *ray, LastPlanes last) {
  const int size = 4 * ISO_MACROCELL_BLOCKS;
  const int cx = w->x / ISO_MACROCELL_BLOCKS, cy = w->y / ISO_MACROCELL_BLOCKS,
            cz = w->z / ISO_MACROCELL_BLOCKS;
  GridWalk coarse = walk_from(ray, cx, cy, cz, size, last);
  const RayEvent exit = walk_exit(&coarse);
  const int bx = cx * ISO_MACROCELL_BLOCKS, by = cy * ISO_MACROCELL_BLOCKS, bz = cz * ISO_MACROCELL_BLOCKS;
  int x, y, z;
  /* Along the exit's axis the neighbour; along the others, where the ray is at that moment. */
  x = exit.axis == 0 ? (ray->x.d > 0.0f ? bx + ISO_MACROCELL_BLOCKS : bx - 1)
                     : locate(ray->x, 0, exit, 4, bx, min(bx + ISO_MACROCELL_BLOCKS - 1, (last.x - 1) / 4));
  y = exit.axis == 1 ? (ray->y.d > 0.0f ? by + ISO_MACROCELL_BLOCKS : by - 1)
                     : locate(ray->y, 1, exit, 4, by, min(by + ISO_MACROCELL_BLOCKS - 1, (last.y - 1) / 4));
  z = exit.axis == 2 ? (ray->z.d > 0.0f ? bz + ISO_MACROCELL_BLOCKS : bz - 1)
                     : locate(ray->z, 2, exit, 4, bz, min(bz + ISO_MACROCELL_BLOCKS - 1, (last.z - 1) / 4));
  return walk_from(ray, x, y, z, 4, last);
}

/// pair_block_ids [active_count * spec_count]: entries a * spec_count + k, k ascending along the ray;
/// ISO_INVALID_ID behind the last. ray_block_ids [pixel]: in, the block to go on from; out, the first block
/// not yet looked at, or ISO_INVALID_ID when the ray has left the volume. macrocell_masks [2 * coarse cells]:
/// bit x + 4y + 16z of a block in its coarse cell.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void traverse(
    constant FrameParams *frame, global const uint *macrocell_masks, global PassCounts *counts,
    global const uint *active_ray_ids, global uint *ray_block_ids, global uint *pair_block_ids) {
  local uint group_pairs;
  const LastPlanes last = last_planes(frame);
  const int end_x = (last.x - 1) / 4 + 1, end_y = (last.y - 1) / 4 + 1, end_z = (last.z - 1) / 4 + 1;
  const uint coarse_x = (frame->blocks_x + 3) / 4, coarse_y = (frame->blocks_y + 3) / 4;
  const uint active_count = counts->active_count, spec_count = counts->spec_count;
  uint pairs = 0;
  if (get_local_id(0) == 0) group_pairs = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint a = get_global_id(0); a < active_count; a += get_global_size(0)) {
    const uint ray_id = active_ray_ids[a];
    const Ray ray = make_ray(frame, ray_id);
    const BlockCoords from = block_coords(frame, ray_block_ids[ray_id]);
    GridWalk w = walk_from(&ray, (int)from.x, (int)from.y, (int)from.z, 4, last);
    int within = 1;
    uint k = 0;
    while (within && k < spec_count) {
      const uint coarse = (uint)(w.x >> 2) + coarse_x * ((uint)(w.y >> 2) + coarse_y * (uint)(w.z >> 2));
      const uint low = macrocell_masks[2 * coarse], high = macrocell_masks[2 * coarse + 1];
      if ((low | high) == 0) {
        w = leave_macrocell(&w, &ray, last);
      } else {
        const uint bit = (uint)((w.x & 3) + 4 * (w.y & 3) + 16 * (w.z & 3));
        if ((bit < 32 ? low >> bit : high >> (bit - 32)) & 1u) {
          pair_block_ids[a * spec_count + k++] = block_id_at(frame, (uint)w.x, (uint)w.y, (uint)w.z);
        }
        walk_step(&w, &ray, walk_exit(&w), 4, last);
      }
      within = w.x >= 0 && w.x < end_x && w.y >= 0 && w.y < end_y && w.z >= 0 && w.z < end_z;
    }
    pairs += k;
    for (; k < spec_count; ++k) pair_block_ids[a * spec_count + k] = ISO_INVALID_ID;
    ray_block_ids[ray_id] = within ? block_id_at(frame, (uint)w.x, (uint)w.y, (uint)w.z) : ISO_INVALID_ID;
  }
  if (pairs != 0) atomic_add(&group_pairs, pairs);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && group_pairs != 0) atomic_add(&counts->pair_count, group_pairs);
}
