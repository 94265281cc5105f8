/// march.cl -- pipeline `rays`: each ray walks through the active blocks and intersects those that are cached; at the first
/// that is not it waits, and asks for that block and its next candidates (Sec. 3.3, 4).
///
/// march_all (every pixel) -> [ request_blocks -> cache -> decode -> march ]*. No sort and no composite: a ray's blocks come in
/// ray order, so its first change is its hit.
#include "block_requests.h"
#include "block_walk.h"
#include "cell_intersect.h"

/// An entry of the active lists: pixel | log2 of the ray's own look-ahead << 28 | in doubt << 31.
#define ISO_RAY_PIXEL 0x0FFFFFFFu
#define ISO_RAY_AHEAD_SHIFT 28u
#define ISO_RAY_AHEAD_MAX 6u
#define ISO_RAY_IN_DOUBT 0x80000000u

/// What became of a ray.
#define ISO_RAY_LEFT 0   ///< it left the volume
#define ISO_RAY_HIT 1    ///< equal to what isolate() returns, as is
#define ISO_RAY_DOUBT 2  ///< request_blocks() settles it
#define ISO_RAY_WAITS 3  ///< for a block that is not cached
#if ISO_RAY_DOUBT != ISO_DOUBTFUL
#error "a result of isolate() must stand for itself"
#endif

/// The corners of the dual grid (bits 0..7, corner x + 2y + 4z) whose blocks the voxels of local cell (x,y,z) lie in.
inline uint cell_blocks(int x, int y, int z) {
  const int border = (x == 3 ? 1 : 0) + (y == 3 ? 2 : 0) + (z == 3 ? 4 : 0);
  return (uint)(0xFF5533110F050301ul >> (8 * border)) & 0xFFu;
}

/// The cell of block b in which the ray is just after `enter`, by which it entered the block.
inline GridWalk enter_block(const Ray *ray, BlockCoords b, RayEvent enter, LastPlanes last) {
  const int x0 = 4 * (int)b.x, y0 = 4 * (int)b.y, z0 = 4 * (int)b.z;
  return walk_from(ray, locate(ray->x, 0, enter, 1, x0, min(x0 + 3, last.x - 1)),
                   locate(ray->y, 1, enter, 1, y0, min(y0 + 3, last.y - 1)),
                   locate(ray->z, 2, enter, 1, z0, min(z0 + 3, last.z - 1)), 1, last);
}

inline int in_block(const GridWalk *cell, BlockCoords b, LastPlanes last) {
  return cell->x >> 2 == (int)b.x && cell->y >> 2 == (int)b.y && cell->z >> 2 == (int)b.z &&
         cell->x < last.x && cell->y < last.y && cell->z < last.z;
}

/// A change of inside, or doubt, in a cell of a block.
typedef struct BlockChange {
  CellChange change;
  GridWalk cell;
  RayEvent enter;
  float w[8];
} BlockChange;

/// Walks the cells of block b. Returns ISO_RAY_LEFT (the block), ISO_RAY_HIT, ISO_RAY_DOUBT, or ISO_RAY_WAITS where a block of
/// the dual grid is not cached. slots: this work-item's place for eight, ISO_GROUP_SIZE apart.
/// precise: settle doubts on the spot.
inline int march_block(constant FrameParams *frame, global const BlockEntry *table,
                       global const float *cache_values, const Ray *ray, BlockCoords b, LastPlanes last,
                       local uint *slots, int precise, BlockChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  uint have = 0;
  found->enter = region_entry(ray, (int)b.x, (int)b.y, (int)b.z, 4, last);
  found->cell = enter_block(ray, b, found->enter, last);
  while (in_block(&found->cell, b, last)) {
    const int x = found->cell.x & 3, y = found->cell.y & 3, z = found->cell.z & 3;
    const RayEvent exit = walk_exit(&found->cell);
    const uint need = cell_blocks(x, y, z) & ~have;
    int result;
    if (need != 0) {
      for (uint corner = 0; corner < 8; ++corner) {
        if ((need >> corner & 1u) != 0) {
          const uint slot =
              cached_slot(frame, table, b.x + (corner & 1), b.y + (corner >> 1 & 1), b.z + (corner >> 2));
          if (slot == ISO_BLOCK_ABSENT) return ISO_RAY_WAITS;
          slots[corner * ISO_GROUP_SIZE] = slot;
        }
      }
      have |= need;
    }
    for (int corner = 0; corner < 8; ++corner) {
      const int vx = x + (corner & 1), vy = y + (corner >> 1 & 1), vz = z + (corner >> 2);
      const uint slot = slots[((vx >> 2) + 2 * (vy >> 2) + 4 * (vz >> 2)) * ISO_GROUP_SIZE];
      found->w[corner] =
          cache_values[slot * ISO_BLOCK_VOXELS + (uint)((vx & 3) + 4 * (vy & 3) + 16 * (vz & 3))] -
          frame->isovalue;
    }
    result = precise ? change_in_cell(solver, ray, found->w, found->cell.x, found->cell.y, found->cell.z,
                                      found->enter, exit, &found->change)
                     : change_or_doubt_in_cell(solver, ray, found->w, found->cell.x, found->cell.y,
                                               found->cell.z, found->enter, exit, &found->change);
    if (result != 0) return result;
    walk_step(&found->cell, ray, exit, 1, last);
    found->enter = exit;
  }
  return ISO_RAY_LEFT;
}

inline HitRecord hit_of(constant FrameParams *frame, const Ray *ray, const BlockChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  return make_hit(frame, ray, found->w, found->cell.x, found->cell.y, found->cell.z, found->enter,
                  walk_exit(&found->cell), refine(solver, found->change.cubic, found->change.bracket));
}

/// Appends the rays that go on to next_active_ray_ids. Called by whole work-groups.
/// goes_on: this work-item has one. counters [2] of the work-group: 0 on entry and on return.
inline void append_ray(int goes_on, uint entry, volatile local uint *counters, volatile global uint *count,
                       global uint *list) {
  uint place = 0;
  if (goes_on) place = atomic_inc(&counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0 && counters[0] != 0) counters[1] = atomic_add(count, counters[0]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (goes_on) list[counters[1] + place] = entry;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
}

/// The pixel of work-item i when work-items are laid over the image in tiles of 8 x 4, so that neighbours share blocks; or
/// ISO_INVALID_ID beyond its edge.
inline uint tiled_pixel(constant FrameParams *frame, uint i) {
  const uint tiles_x = (frame->width + 7) / 8, tile = i / 32;
  const uint x = 8 * (tile % tiles_x) + (i & 7), y = 4 * (tile / tiles_x) + (i >> 3 & 3);
  return x < frame->width && y < frame->height ? x + frame->width * y : ISO_INVALID_ID;
}

/// Opens the counts of the pass after this one. One work-item; nobody else reads *next now.
inline void open_next_counts(global const PassCounts *counts, global PassCounts *next, int first) {
  uint window = counts->pixel_count;
  if (!first) { /* see begin_pass() in speculation.cl */
    window = counts->window_count;
    window = counts->requested_count > counts->decoded_count ? window / 2 : window + window / 4 + 1;
    window = clamp(window, 1u, counts->pixel_count);
  }
  next->pixel_count = counts->pixel_count;
  next->pass = counts->pass + 1;
  next->active_count = next->spec_count = next->pair_slot_count = next->pair_count = 0;
  next->window_count = window;
  next->granted_count = next->visible_count = next->requested_count = next->decoded_count = 0;
  next->hit_count = next->next_active_count = 0;
  next->free_count = counts->free_count;
}

/// Walks rays on until they hit, leave or wait. first: every pixel's ray from the eye; otherwise active_ray_ids
/// [counts->active_count], each from ray_block_ids [pixel] (ISO_INVALID_ID: settled, nothing to do). Out: hits [pixel],
/// next_active_ray_ids [counts->next_active_count] and their ray_block_ids; *next is opened for the next pass.
/// macrocell_masks: as traverse(). Groups stride over the rays.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void march(
    constant FrameParams *frame, uint first, global const uint *macrocell_masks,
    global const BlockEntry *table, global const float *cache_values, global PassCounts *counts,
    global PassCounts *next, global const uint *active_ray_ids, global uint *next_active_ray_ids,
    global uint *ray_block_ids, global HitRecord *hits) {
  local uint slots[8 * ISO_GROUP_SIZE];
  local uint counters[2], group_hits, group_blocks;
  const LastPlanes last = last_planes(frame);
  const uint item = get_local_id(0);
  const uint num_rays =
      first ? (frame->width + 7) / 8 * ((frame->height + 3) / 4) * 32 : counts->active_count;
  uint num_hits = 0, num_blocks = 0;
  if (get_global_id(0) == 0) {
    open_next_counts(counts, next, (int)first);
    if (first) counts->active_count = counts->pixel_count;
  }
  if (item == 0) counters[0] = group_hits = group_blocks = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_rays;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint i = begin + item;
    uint pixel = ISO_INVALID_ID, entry = 0, block_id = ISO_INVALID_ID;
    int result = ISO_RAY_LEFT;
    if (first) {
      pixel = tiled_pixel(frame, i);
      entry = pixel | 1u << ISO_RAY_AHEAD_SHIFT;
    } else if (i < num_rays) {
      entry = active_ray_ids[i];
      block_id = ray_block_ids[entry & ISO_RAY_PIXEL];
      pixel = block_id == ISO_INVALID_ID ? ISO_INVALID_ID : entry & ISO_RAY_PIXEL;
    }
    if (pixel != ISO_INVALID_ID) {
      const Ray ray = make_ray(frame, pixel);
      const BlockCoords from = block_coords(frame, first ? 0 : block_id);
      int x = (int)from.x, y = (int)from.y, z = (int)from.z;
      int within = 1;
      BlockChange found;
      BlockWalk walk;
      if (first) {
        RayEvent enter;
        within = domain_entry(&ray, last, &enter);
        if (within) { /* blocks that own no cell (one last voxel layer) are never entered */
          x = locate(ray.x, 0, enter, 4, 0, (last.x - 1) / 4);
          y = locate(ray.y, 1, enter, 4, 0, (last.y - 1) / 4);
          z = locate(ray.z, 2, enter, 4, 0, (last.z - 1) / 4);
        }
      }
      if (within) walk = block_walk_from(frame, macrocell_masks, &ray, x, y, z, last);
      while (within && result == ISO_RAY_LEFT) {
        within = find_active_block(frame, macrocell_masks, &ray, last, &walk);
        if (within) {
          const BlockCoords b = {(uint)walk.block.x, (uint)walk.block.y, (uint)walk.block.z};
          result = march_block(frame, table, cache_values, &ray, b, last, slots + item, 0, &found);
          if (result == ISO_RAY_LEFT) within = leave_block(&ray, last, &walk);
          num_blocks += result != ISO_RAY_WAITS;
        }
      }
      if (result == ISO_RAY_HIT) {
        hits[pixel] = hit_of(frame, &ray, &found);
        ++num_hits;
      } else if (first || result == ISO_RAY_LEFT) {
        hits[pixel] = no_hit();
      }
      if (result == ISO_RAY_WAITS || result == ISO_RAY_DOUBT) {
        const uint waits_at = walk_block_id(frame, &walk);
        const uint ahead = entry >> ISO_RAY_AHEAD_SHIFT & 7u;
        ray_block_ids[pixel] = waits_at;
        entry = pixel | (waits_at == block_id ? ahead : min(ahead + 1, ISO_RAY_AHEAD_MAX))
                            << ISO_RAY_AHEAD_SHIFT;
        if (result == ISO_RAY_DOUBT) entry |= ISO_RAY_IN_DOUBT;
      }
    }
    append_ray(result == ISO_RAY_WAITS || result == ISO_RAY_DOUBT, entry, counters,
               &counts->next_active_count, next_active_ray_ids);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  if (num_blocks != 0) atomic_add(&group_blocks, num_blocks);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
  if (item == 0 && group_blocks != 0) atomic_add(&counts->granted_count, group_blocks);
}

/// The blocks of the dual grid of block b that the ray's cells there touch (bits 0..7, corner x + 2y + 4z).
inline uint touched_blocks(const Ray *ray, BlockCoords b, LastPlanes last) {
  const RayEvent enter = region_entry(ray, (int)b.x, (int)b.y, (int)b.z, 4, last);
  GridWalk cell = enter_block(ray, b, enter, last);
  uint touched = 0;
  while (in_block(&cell, b, last)) {
    touched |= cell_blocks(cell.x & 3, cell.y & 3, cell.z & 3);
    walk_step(&cell, ray, walk_exit(&cell), 1, last);
  }
  return touched;
}

#define ISO_REQUEST_STAGING 256u  ///< requests that a work-group collects before it writes them out

/// Of the rays that wait, those among the first counts->window_count settle their doubt, if any, and ask for the blocks that
/// they touch in the next active blocks: N_Spec of them (Sec. 4), or their own number of
/// frame->per_ray_speculation. prev: the counts of the pass before.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void request_blocks(
    constant FrameParams *frame, global const uint *macrocell_masks, global const BlockEntry *table,
    global const float *cache_values, global const PassCounts *prev, global PassCounts *counts,
    global const uint *active_ray_ids, global uint *ray_block_ids, global HitRecord *hits,
    global uint *slot_stamps, global uint *requested_bits, global uint *request_block_ids, uint capacity,
    global CacheState *cache) {
  local uint slots[8 * ISO_GROUP_SIZE];
  local uint staged[ISO_REQUEST_STAGING];
  local uint num_staged, list_begin, group_hits;
  const LastPlanes last = last_planes(frame);
  const uint item = get_local_id(0), pass = counts->pass;
  const uint active = prev->next_active_count, window = min(active, counts->window_count);
  const uint fair_share = active == 0 ? 0 : min(frame->max_spec_count, counts->pixel_count / active);
  uint num_hits = 0;
  if (get_global_id(0) == 0) {
    open_requests(cache);
    counts->active_count = active;
    counts->spec_count = fair_share;
    if (active == 0) cache->first_block_id = ISO_INVALID_ID;
  }
  if (item == 0) num_staged = group_hits = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < window;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint a = begin + item;
    if (a < window) {
      const uint entry = active_ray_ids[a];
      const uint pixel = entry & ISO_RAY_PIXEL, block_id = ray_block_ids[pixel];
      const Ray ray = make_ray(frame, pixel);
      const BlockCoords from = block_coords(frame, block_id);
      const uint ahead = frame->per_ray_speculation
                             ? min(1u << (entry >> ISO_RAY_AHEAD_SHIFT & 7u), frame->max_spec_count)
                             : fair_share;
      BlockWalk walk =
          block_walk_from(frame, macrocell_masks, &ray, (int)from.x, (int)from.y, (int)from.z, last);
      int within = 1;
      if (entry & ISO_RAY_IN_DOUBT) {
        BlockChange found;
        const int result = march_block(frame, table, cache_values, &ray, from, last, slots + item, 1, &found);
        if (result == ISO_RAY_HIT) {
          hits[pixel] = hit_of(frame, &ray, &found);
          ray_block_ids[pixel] = ISO_INVALID_ID;
          ++num_hits;
          within = 0;
        } else if (result == ISO_RAY_LEFT) {
          within = leave_block(&ray, last, &walk);
          ray_block_ids[pixel] = within ? walk_block_id(frame, &walk) : ISO_INVALID_ID;
        }
      }
      if (a == 0) cache->first_block_id = ISO_INVALID_ID;
      for (uint k = 0; within && k < ahead; ++k) {
        within = find_active_block(frame, macrocell_masks, &ray, last, &walk);
        if (within) {
          const BlockCoords b = {(uint)walk.block.x, (uint)walk.block.y, (uint)walk.block.z};
          const uint touched = touched_blocks(&ray, b, last);
          if (a == 0 && k == 0) cache->first_block_id = walk_block_id(frame, &walk);
          for (uint corner = 0; corner < 8; ++corner) {
            const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
            if ((touched >> corner & 1u) != 0 &&
                request_block(frame, table, slot_stamps, pass, requested_bits, x, y, z)) {
              const uint place = atomic_inc(&num_staged), wanted = block_id_at(frame, x, y, z);
              if (place < ISO_REQUEST_STAGING) {
                staged[place] = wanted;
              } else {
                list_request(frame, request_block_ids, capacity, requested_bits,
                             atomic_inc(&counts->requested_count), wanted);
              }
            }
          }
          within = leave_block(&ray, last, &walk);
        }
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0 && num_staged != 0) {
      list_begin = atomic_add(&counts->requested_count, min(num_staged, ISO_REQUEST_STAGING));
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = item; i < min(num_staged, ISO_REQUEST_STAGING); i += ISO_GROUP_SIZE) {
      list_request(frame, request_block_ids, capacity, requested_bits, list_begin + i, staged[i]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) num_staged = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
}
