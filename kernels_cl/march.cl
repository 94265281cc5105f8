/// march.cl -- pipeline `rays`: each ray walks through the active blocks and intersects those that are cached; at the first
/// that is not it waits, and asks for that block and its next candidates (Sec. 3.3, 4).
///
/// start_rays -> march -> [ cache -> decode -> march ]*. No sort and no composite: a ray's blocks come in ray order, so its
/// first change is its hit.
#define ISO_FOUND local
#include "block_requests.h"
#include "block_walk.h"
#include "cell_intersect.h"

/// What became of a ray.
#define ISO_RAY_LEFT 0   ///< it left the volume
#define ISO_RAY_HIT 1    ///< equal to what isolate() returns, as is
#define ISO_RAY_DOUBT 2  ///< the next march settles it
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

/// The cells of a block (bit x + 4y + 16z) whose corners are not all on one side. inside [8]: which voxels of the blocks of
/// its dual grid are inside; where one is not known, the cells that need it have any bit.
inline ulong changing_cells(const ulong *inside) {
  /* Voxels at +x of every cell: own voxels moved one down, the last layer from the neighbour. The same for +y, +z. */
  const ulong not_x3 = 0x7777777777777777ul, not_y3 = 0x0FFF0FFF0FFF0FFFul, not_z3 = 0x0000FFFFFFFFFFFFul;
  ulong v[8], any = 0, all = ~0ul;
  for (int i = 0; i < 8; ++i) v[i] = inside[i];
  for (int i = 0; i < 8; i += 2) v[i + 1] = (v[i] >> 1 & not_x3) | (v[i + 1] << 3 & ~not_x3);
  for (int i = 0; i < 8; i += 4) {
    v[i + 2] = (v[i] >> 4 & not_y3) | (v[i + 2] << 12 & ~not_y3);
    v[i + 3] = (v[i + 1] >> 4 & not_y3) | (v[i + 3] << 12 & ~not_y3);
  }
  for (int i = 0; i < 4; ++i) v[i + 4] = (v[i] >> 16 & not_z3) | (v[i + 4] << 48 & ~not_z3);
  for (int i = 0; i < 8; ++i) {
    any |= v[i];
    all &= v[i];
  }
  return any & ~all;
}

/// Walks the cells of block b. Returns ISO_RAY_LEFT (the block), ISO_RAY_HIT, ISO_RAY_DOUBT, or ISO_RAY_WAITS where a block of
/// the dual grid is not cached. slots: this work-item's place for eight, ISO_GROUP_SIZE apart.
/// precise: settle doubts on the spot.
inline int march_block(constant FrameParams *frame, global const BlockEntry *table,
                       global const float *cache_values, const Ray *ray, BlockCoords b, LastPlanes last,
                       local uint *slots, int precise, BlockChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  ulong inside[8], changing;
  uint have = 0;
  int result = ISO_RAY_LEFT;
  for (uint corner = 0; corner < 8; ++corner) {
    const uint entry =
        find_entry(frame, table, b.x + (corner & 1), b.y + (corner >> 1 & 1), b.z + (corner >> 2));
    const uint slot = entry == ISO_INVALID_ID ? ISO_BLOCK_ABSENT : table[entry].slot;
    slots[corner * ISO_GROUP_SIZE] = slot;
    inside[corner] =
        slot == ISO_BLOCK_ABSENT ? 0 : (ulong)table[entry].inside_high << 32 | table[entry].inside_low;
    have |= (uint)(slot != ISO_BLOCK_ABSENT) << corner;
  }
  changing = changing_cells(inside);
  if (changing == 0 && have == 0xFFu) return ISO_RAY_LEFT;
  found->enter = region_entry(ray, (int)b.x, (int)b.y, (int)b.z, 4, last);
  found->cell = enter_block(ray, b, found->enter, last);
  while (result == ISO_RAY_LEFT && in_block(&found->cell, b, last)) {
    const int x = found->cell.x & 3, y = found->cell.y & 3, z = found->cell.z & 3;
    const RayEvent exit = walk_exit(&found->cell);
    if ((cell_blocks(x, y, z) & ~have) != 0) {
      result = ISO_RAY_WAITS;
    } else if ((changing >> (x + 4 * y + 16 * z) & 1ul) != 0) {
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
    }
    if (result == ISO_RAY_LEFT) {
      walk_step(&found->cell, ray, exit, 1, last);
      found->enter = exit;
    }
  }
  return result;
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

/// Opens the counts of the next pass. One work-item; nobody reads *next in this pass.
inline void open_next_counts(global const PassCounts *prev, global const PassCounts *counts,
                             global PassCounts *next) {
  uint window = counts->window_count; /* see begin_pass() in speculation.cl */
  window = prev->requested_count > counts->decoded_count ? window / 2 : window + window / 4 + 1;
  next->pixel_count = counts->pixel_count;
  next->pass = counts->pass + 1;
  next->active_count = next->spec_count = next->pair_slot_count = next->pair_count = 0;
  next->window_count = clamp(window, 1u, counts->pixel_count);
  next->granted_count = next->visible_count = next->requested_count = next->decoded_count = 0;
  next->hit_count = next->next_active_count = 0;
  next->free_count = counts->free_count;
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

#define ISO_BLOCKS_AT_ONCE 8u     ///< that a ray looks for before it intersects them
#define ISO_REQUEST_STAGING 256u  ///< requests that a work-group collects before it writes them out

/// How far a ray has come. found: this work-item's place for ISO_BLOCKS_AT_ONCE, ISO_GROUP_SIZE apart.
typedef struct RayMarch {
  int result;      ///< ISO_RAY_*
  uint next;       ///< the first block not looked for, or ISO_INVALID_ID
  uint num_found;  ///< active blocks looked for ...
  uint at;         ///< ... and the one of them at which the ray stands
} RayMarch;

/// Walks a ray on from block `from`, an active one. in_doubt: about that one. num_blocks: counts the blocks intersected.
inline RayMarch march_ray(constant FrameParams *frame, global const uint *macrocell_masks,
                          global const BlockEntry *table, global const float *cache_values, const Ray *ray,
                          uint from, int in_doubt, LastPlanes last, local uint *slots, local uint *found,
                          uint *num_blocks, BlockChange *change) {
  RayMarch m;
  m.result = ISO_RAY_LEFT;
  m.next = block_behind(frame, ray, block_coords(frame, from), last);
  m.num_found = 1;
  m.at = 0;
  found[0] = from;
  /* One call of each walk: what compilers inline, they compile as often as it is called. */
  while (m.result == ISO_RAY_LEFT && (m.at < m.num_found || m.next != ISO_INVALID_ID)) {
    if (m.at == m.num_found) {
      m.num_found =
          find_blocks(frame, macrocell_masks, ray, &m.next, ISO_BLOCKS_AT_ONCE, found, ISO_GROUP_SIZE);
      m.at = 0;
    }
    while (m.at < m.num_found && m.result == ISO_RAY_LEFT) {
      const BlockCoords b = block_coords(frame, found[m.at * ISO_GROUP_SIZE]);
      m.result = march_block(frame, table, cache_values, ray, b, last, slots, in_doubt, change);
      in_doubt = 0;
      *num_blocks += m.result <= ISO_RAY_HIT;
      if (m.result == ISO_RAY_LEFT) ++m.at;
    }
  }
  return m;
}

/// The request list, and where a work-group collects what it will add to it.
typedef struct Requests {
  global uint *bits, *block_ids;
  uint capacity;
  volatile global uint *count;
  local uint *staged;
  volatile local uint *num_staged;
} Requests;

/// Asks for the blocks that the ray touches in the next `ahead` active blocks, from the one where it stands. Returns which
/// of that one's dual grid it touches.
inline uint request_ahead(constant FrameParams *frame, global const uint *macrocell_masks,
                          global const BlockEntry *table, global uint *slot_stamps, uint pass, const Ray *ray,
                          RayMarch m, uint ahead, LastPlanes last, local uint *found, Requests requests) {
  uint next = m.next, num_found = m.num_found, at = m.at, first_touched = 0;
  for (uint asked = 0; asked < ahead && (at < num_found || next != ISO_INVALID_ID);) {
    if (at == num_found) {
      num_found = find_blocks(frame, macrocell_masks, ray, &next, min(ahead - asked, ISO_BLOCKS_AT_ONCE),
                              found, ISO_GROUP_SIZE);
      at = 0;
    }
    if (at < num_found) {
      const BlockCoords b = block_coords(frame, found[at * ISO_GROUP_SIZE]);
      const uint touched = touched_blocks(ray, b, last);
      if (asked == 0) first_touched = touched;
      for (uint corner = 0; corner < 8; ++corner) {
        const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
        if ((touched >> corner & 1u) != 0 &&
            request_block(frame, table, slot_stamps, pass, requests.bits, x, y, z)) {
          const uint place = atomic_inc(requests.num_staged), block_id = block_id_at(frame, x, y, z);
          if (place < ISO_REQUEST_STAGING) {
            requests.staged[place] = block_id;
          } else {
            list_request(frame, requests.block_ids, requests.capacity, requests.bits,
                         atomic_inc(requests.count), block_id);
          }
        }
      }
      ++at;
      ++asked;
    }
  }
  return first_touched;
}

/// Begins a frame. hits [pixel] = none; next_active_ray_ids [counts->next_active_count]: the pixels whose rays meet an
/// active block, each with that block in ray_block_ids [pixel]. counts: of the frame's last pass, next_active_count 0
/// before; *next: the first pass of this frame is for all rays. A kernel of its own, since it is so much leaner than march
/// that far more of its work-items fit a device at a time. Groups stride over the tiles.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void start_rays(
    constant FrameParams *frame, global const uint *macrocell_masks, global PassCounts *counts,
    global PassCounts *next, global uint *next_active_ray_ids, global uint *ray_block_ids,
    global HitRecord *hits) {
  local uint found[ISO_GROUP_SIZE], counters[2];
  const uint item = get_local_id(0);
  const uint num_tiled = (frame->width + 7) / 8 * ((frame->height + 3) / 4) * 32;
  if (get_global_id(0) == 0) next->window_count = counts->pixel_count;
  if (item == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_tiled;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint pixel = begin + item < num_tiled ? tiled_pixel(frame, begin + item) : ISO_INVALID_ID;
    uint num_found = 0;
    if (pixel != ISO_INVALID_ID) {
      const Ray ray = make_ray(frame, pixel);
      uint block_id = first_block(frame, &ray);
      if (block_id != ISO_INVALID_ID)
        num_found = find_blocks(frame, macrocell_masks, &ray, &block_id, 1, found + item, 1);
      if (num_found != 0) ray_block_ids[pixel] = found[item];
      hits[pixel] = no_hit();
    }
    append_ray(num_found != 0, pixel | 1u << ISO_RAY_AHEAD_SHIFT, counters, &counts->next_active_count,
               next_active_ray_ids);
  }
}

/// Walks rays on until they hit, leave or wait: active_ray_ids [prev->next_active_count], each from ray_block_ids [pixel].
/// Of those that wait, the first counts->window_count ask for the blocks that they touch in their next active blocks:
/// N_Spec of them (Sec. 4), or their own number of frame->per_ray_speculation. Out: hits [pixel]; next_active_ray_ids
/// [counts->next_active_count] and their ray_block_ids; request_block_ids [counts->requested_count, at most capacity];
/// *next, opened. macrocell_masks: as traverse(). Groups stride over the rays.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void march(
    constant FrameParams *frame, global const uint *macrocell_masks, global const BlockEntry *table,
    global const float *cache_values, global const PassCounts *prev, global PassCounts *counts,
    global PassCounts *next, global const uint *active_ray_ids, global uint *next_active_ray_ids,
    global uint *ray_block_ids, global HitRecord *hits, global uint *slot_stamps, global uint *requested_bits,
    global uint *request_block_ids, uint capacity, global CacheState *cache) {
  local uint slots[8 * ISO_GROUP_SIZE], found[ISO_BLOCKS_AT_ONCE * ISO_GROUP_SIZE],
      staged[ISO_REQUEST_STAGING];
  local uint counters[2], num_staged, list_begin, group_hits, group_blocks;
  const Requests requests = {requested_bits, request_block_ids, capacity, &counts->requested_count,
                             staged,         &num_staged};
  const LastPlanes last = last_planes(frame);
  const uint item = get_local_id(0), num_rays = prev->next_active_count;
  const uint fair_share =
      num_rays == 0 ? 0 : clamp(counts->pixel_count / num_rays, 1u, frame->max_spec_count);
  uint num_hits = 0, num_blocks = 0;
  if (get_global_id(0) == 0) {
    open_next_counts(prev, counts, next);
    open_requests(cache);
    cache->first_block_id = ISO_INVALID_ID;
    counts->active_count = num_rays;
    counts->spec_count = fair_share;
  }
  if (item == 0) counters[0] = num_staged = group_hits = group_blocks = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_rays;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint i = begin + item;
    uint entry = i < num_rays ? active_ray_ids[i] : ISO_INVALID_ID;
    int waits = 0;
    if (i < num_rays) {
      const uint pixel = entry & ISO_RAY_PIXEL, from = ray_block_ids[pixel];
      const Ray ray = make_ray(frame, pixel);
      BlockChange change;
      const RayMarch m =
          march_ray(frame, macrocell_masks, table, cache_values, &ray, from, (entry & ISO_RAY_IN_DOUBT) != 0,
                    last, slots + item, found + item, &num_blocks, &change);
      waits = m.result >= ISO_RAY_DOUBT;
      if (m.result == ISO_RAY_HIT) {
        hits[pixel] = hit_of(frame, &ray, &change);
        ++num_hits;
      }
      if (waits) {
        const uint block_id = found[m.at * ISO_GROUP_SIZE + item];
        uint log_ahead = entry >> ISO_RAY_AHEAD_SHIFT & 7u;
        if (block_id != from) log_ahead = min(log_ahead + 1, ISO_RAY_AHEAD_MAX);
        entry =
            pixel | log_ahead << ISO_RAY_AHEAD_SHIFT | (m.result == ISO_RAY_DOUBT ? ISO_RAY_IN_DOUBT : 0u);
        ray_block_ids[pixel] = block_id;
        if (i < counts->window_count) {
          const uint touched = request_ahead(
              frame, macrocell_masks, table, slot_stamps, counts->pass, &ray, m,
              frame->per_ray_speculation ? min(1u << log_ahead, frame->max_spec_count) : fair_share, last,
              found + item, requests);
          if (i == 0) {
            cache->first_block_id = block_id;
            cache->first_touched = touched;
          }
        }
      }
    }
    append_ray(waits, entry, counters, &counts->next_active_count, next_active_ray_ids);
    if (item == 0) list_begin = atomic_add(requests.count, min(num_staged, ISO_REQUEST_STAGING));
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint j = item; j < min(num_staged, ISO_REQUEST_STAGING); j += ISO_GROUP_SIZE) {
      list_request(frame, request_block_ids, capacity, requested_bits, list_begin + j, staged[j]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) num_staged = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  if (num_blocks != 0) atomic_add(&group_blocks, num_blocks);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
  if (item == 0 && group_blocks != 0) atomic_add(&counts->granted_count, group_blocks);
}
