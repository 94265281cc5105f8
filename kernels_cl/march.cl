/// march.cl -- pipeline `rays`: each ray walks through the active blocks and intersects those that are cached; at the first
/// that is not it waits, and asks for that block and its next candidates (Sec. 3.3, 4).
///
/// start_rays -> march -> request_ahead -> [ cache -> decode -> march -> request_ahead ]*. No sort and no composite: a ray's blocks come in ray order, so its
/// first change is its hit.
#define ISO_FOUND local
#include "block_cells.h"
#include "block_requests.h"
#include "block_walk.h"
#include "cell_intersect.h"
#include "touched_blocks.h"

/// What became of a ray.
#define ISO_RAY_LEFT 0   ///< it left the volume
#define ISO_RAY_HIT 1    ///< equal to what isolate() returns, as is
#define ISO_RAY_DOUBT 2  ///< the next march settles it
#define ISO_RAY_WAITS 3  ///< for a block that is not cached
#define ISO_RAY_ENDS 4   ///< its band ends here; + 1: inside
#if ISO_RAY_DOUBT != ISO_DOUBTFUL
#error "a result of isolate() must stand for itself"
#endif

/// The corners of the dual grid (bits 0..7, corner x + 2y + 4z) whose blocks the voxels of local cell (x,y,z) lie in.
ISO_INLINE uint cell_blocks(int x, int y, int z) {
  const int border = (x == 3 ? 1 : 0) + (y == 3 ? 2 : 0) + (z == 3 ? 4 : 0);
  return (uint)(0xFF5533110F050301ul >> (8 * border)) & 0xFFu;
}

/// A change of inside, or doubt, in a cell of a block.
typedef struct BlockChange {
  CellChange change;
  GridWalk cell;
  RayEvent enter;
  float w[8];
  int at_border;  ///< it is where the cell is entered: a level of detail has another opinion than the one before
} BlockChange;

/// The cells of a block that have voxels of any of those corners.
ISO_INLINE ulong cells_of_corners(uint corners) {
  const ulong x3 = 0x8888888888888888ul, y3 = 0xF000F000F000F000ul, z3 = 0xFFFF000000000000ul;
  ulong cells = 0;
  for (uint corner = 0; corner < 8; ++corner) {
    if ((corners >> corner & 1u) != 0)
      cells |=
          ((corner & 1) != 0 ? x3 : ~0ul) & ((corner & 2) != 0 ? y3 : ~0ul) & ((corner & 4) != 0 ? z3 : ~0ul);
  }
  return cells;
}

/// Which cells of block b a ray must look into: those in which inside changes, and those that need a block that is not cached.
/// What is found out stays in the block's table entry for the next who asks. Out: slots [8] of the dual grid, ISO_GROUP_SIZE apart;
/// *have: which of its corners are cached, or beyond the volume, where no cell of the domain reaches.
ISO_INLINE ulong open_block(const FrameParams *frame, global BlockEntry *table, global const ulong *inside,
                            BlockCoords b, local uint *slots, uint *have) {
  BlockEntry entries[8];
  ulong cells;
  find_dual_grid(frame, table, b.x, b.y, b.z, entries);
  *have = (b.x + 1 == frame->blocks_x ? 0xAAu : 0u) | (b.y + 1 == frame->blocks_y ? 0xCCu : 0u) |
          (b.z + 1 == frame->blocks_z ? 0xF0u : 0u);
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    slots[corner * ISO_GROUP_SIZE] = entries[corner].slot;
    *have |= (uint)(entries[corner].slot != ISO_BLOCK_ABSENT) << corner;
  }
  cells = (ulong)entries[0].changing_high << 32 | entries[0].changing_low;
  if ((*have & 1u) != 0 && cells == ISO_CHANGING_UNKNOWN) {
    ulong voxels[8];
    ISO_UNROLL
    for (uint corner = 0; corner < 8; ++corner) {
      voxels[corner] = entries[corner].slot == ISO_BLOCK_ABSENT ? 0 : inside[entries[corner].slot];
    }
    cells = changing_cells(voxels) | cells_of_corners(~*have & 0xFFu);
    if (!ISO_CHECK_RACES && *have == 0xFFu) {
      global BlockEntry *entry = &table[find_entry(frame, table, b.x, b.y, b.z)];
      entry->changing_low = (uint)cells;
      entry->changing_high = (uint)(cells >> 32);
    }
  }
  return cells;
}

/// Where the ray's band begins, if it has not entered the region before.
ISO_INLINE RayEvent band_entry(const FrameParams *frame, RayEvent entry) {
  const RayEvent begin = border_event(ISO_LEVELS ? frame->begin_t : 0.0f);
  return ISO_LEVELS && event_before(entry, begin) ? begin : entry;
}

/// Where it ends, if it does before the ray leaves the region.
ISO_INLINE RayEvent band_exit(const FrameParams *frame, RayEvent exit) {
  return ends_band(frame, exit) ? border_event(frame->end_t) : exit;
}

/// Walks the cells of block b. Returns ISO_RAY_LEFT (the block), ISO_RAY_HIT, ISO_RAY_DOUBT, ISO_RAY_WAITS where a block of
/// the dual grid is not cached, or how ISO_RAY_ENDS. slots: this work-item's place for eight, ISO_GROUP_SIZE apart.
/// precise: settle doubts on the spot. side: where the ray was before the border at which its band begins in this block.
ISO_INLINE int march_block(const FrameParams *frame, global BlockEntry *table, global const ulong *inside,
                           global const float *cache_values, const Ray *ray, BlockCoords b, LastPlanes last,
                           local uint *slots, int precise, uint side, BlockChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  uint have;
  int result = ISO_RAY_LEFT, left = 0, ends = 0, ends_here = 0;
  const ulong cells = open_block(frame, table, inside, b, slots, &have);
  if ((have & 1u) == 0) return ISO_RAY_WAITS;
  if (!ISO_LEVELS && cells == 0) return ISO_RAY_LEFT;
  const GridWalk block = walk_from(ray, (int)b.x, (int)b.y, (int)b.z, 4, last);
  if (ISO_LEVELS) ends = ends_band(frame, walk_exit(&block, ray));
  if (cells == 0 && side == ISO_SIDE_UNKNOWN && !ends) return ISO_RAY_LEFT;
  found->enter = band_entry(frame, region_entry(ray, (int)b.x, (int)b.y, (int)b.z, 4, last));
  found->cell = enter_block(ray, b, found->enter, last);
  found->at_border = 0;
  while (result == ISO_RAY_LEFT && !left) {
    const int x = found->cell.x & 3, y = found->cell.y & 3, z = found->cell.z & 3;
    const RayEvent cell_exit = walk_exit(&found->cell, ray);
    const RayEvent exit = band_exit(frame, cell_exit);
    if (ISO_LEVELS) ends_here = ends && ends_band(frame, cell_exit);
    if ((cells >> (x + 4 * y + 16 * z) & 1ul) != 0 || side != ISO_SIDE_UNKNOWN || ends_here) {
      const uint needed = cell_blocks(x, y, z);
      if ((needed & ~have) != 0) {
        result = ISO_RAY_WAITS;
      } else {
        for (int corner = 0; corner < 8; ++corner) {
          const int vx = x + (corner & 1), vy = y + (corner >> 1 & 1), vz = z + (corner >> 2);
          const uint slot = slots[((vx >> 2) + 2 * (vy >> 2) + 4 * (vz >> 2)) * ISO_GROUP_SIZE];
          found->w[corner] =
              cache_values[slot * ISO_BLOCK_VOXELS + (uint)((vx & 3) + 4 * (vy & 3) + 16 * (vz & 3))] -
              frame->isovalue;
        }
        if (ISO_LEVELS && side != ISO_SIDE_UNKNOWN)
          found->at_border = inside_at(ray, found->w, found->enter, found->cell.x, found->cell.y,
                                       found->cell.z, 0) != (side == ISO_SIDE_INSIDE);
        result = found->at_border ? ISO_RAY_HIT
                 : precise        ? change_in_cell(solver, ray, found->w, found->cell.x, found->cell.y,
                                                   found->cell.z, found->enter, exit, &found->change)
                           : change_or_doubt_in_cell(solver, ray, found->w, found->cell.x, found->cell.y,
                                                     found->cell.z, found->enter, exit, &found->change);
        if (result == ISO_RAY_LEFT && ends_here)
          result =
              ISO_RAY_ENDS + inside_at(ray, found->w, exit, found->cell.x, found->cell.y, found->cell.z, 1);
      }
    }
    if (result == ISO_RAY_LEFT) {
      left = leaves(&found->cell, &block, cell_exit);
      walk_step(&found->cell, ray, cell_exit, 1, last);
      found->enter = cell_exit;
      side = ISO_SIDE_UNKNOWN;
    }
  }
  return result;
}

ISO_INLINE HitRecord hit_of(const FrameParams *frame, const Ray *ray, const BlockChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  const float s =
      ISO_LEVELS && found->at_border ? 0.0f : refine(solver, found->change.cubic, found->change.bracket);
  return make_hit(frame, ray, found->w, found->cell.x, found->cell.y, found->cell.z, found->enter,
                  band_exit(frame, walk_exit(&found->cell, ray)), s);
}

/// Appends the rays that go on to next_active_ray_ids. Called by whole work-groups.
/// goes_on: this work-item has one. counters [2] of the work-group: 0 on entry and on return.
ISO_INLINE void append_ray(int goes_on, uint entry, volatile local uint *counters,
                           volatile global uint *count, global uint *list) {
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

/// Work-items for each ray: as many as there are, up to one for each block of a round.
ISO_INLINE uint lanes_per_ray(uint num_rays) {
  uint lanes = ISO_BLOCKS_AT_ONCE;
  while (lanes > 1 && lanes * num_rays > get_global_size(0)) lanes /= 2;
  return lanes;
}

ISO_INLINE uint num_pixels(const FrameParams *frame) {
  return frame->width * frame->height;
}

/// Opens the counts of the next pass. One work-item; nobody reads *next in this pass.
ISO_INLINE void open_next_counts(const FrameParams *frame, global const PassCounts *prev,
                                 global const PassCounts *counts, global PassCounts *next) {
  uint window = counts->window_count; /* see begin_pass() in speculation.cl */
  window = prev->requested_count > counts->decoded_count ? window / 2 : window + window / 4 + 1;
  next->pixel_count = num_pixels(frame);
  next->pass = counts->pass + 1;
  next->active_count = next->spec_count = next->pair_slot_count = next->pair_count = 0;
  next->window_count = clamp(window, 1u, num_pixels(frame));
  next->granted_count = next->visible_count = next->requested_count = next->decoded_count = 0;
  next->hit_count = next->next_active_count = 0;
  next->free_count = counts->free_count;
}

#define ISO_HIT_WORDS ((uint)(sizeof(HitRecord) / sizeof(uint)))

/// hits [count] = no_hit(), by a work-group. Seen as words, in fours, of which neighbours write neighbours: records are 36 bytes
/// long, so that the nine stores of each would be scattered.
ISO_INLINE void clear_hits(global uint *words, uint count) {
  const uint num_words = ISO_HIT_WORDS * count;
  for (uint i = 4 * get_local_id(0); i < num_words; i += 4 * ISO_GROUP_SIZE) {
    const uint4 at = i % ISO_HIT_WORDS + (uint4)(0, 1, 2, 3);
    const uint4 field = select(at, at - ISO_HIT_WORDS, at >= ISO_HIT_WORDS); /* t; block_id and cell; zeros */
    const uint4 ids = select((uint4)(0), (uint4)(ISO_INVALID_ID), field < 3);
    const uint4 words_of_none = select(ids, as_uint4((float4)(INFINITY)), field == 0);
    if (i + 4 <= num_words) {
      vstore4(words_of_none, 0, words + i);
    } else { /* the image's last few */
      words[i] = words_of_none.x;
      if (i + 1 < num_words) words[i + 1] = words_of_none.y;
      if (i + 2 < num_words) words[i + 2] = words_of_none.z;
    }
  }
}

/// Which of the levels of detail that draw a frame, frames [num_frames], the finest first, has the block with this id.
ISO_INLINE uint level_of(global const FrameParams *frames, uint num_frames, uint block_id) {
  const uint layer = block_id / (frames[0].id_blocks_x * frames[0].id_blocks_y);
  uint level = 0;
  while (level + 1 < num_frames && layer >= frames[level + 1].id_begin_z) ++level;
  return level;
}

/// The side on which a whole block is; unknown if it is active. See macrocells.cl: the range of one that is not is on its side, too.
ISO_INLINE uint side_of_block(const FrameParams *frame, global const uint *macrocell_masks,
                              global const ushort *ranges, BlockCoords b) {
  if (is_active(frame, macrocell_masks, b)) return ISO_SIDE_UNKNOWN;
  return ranges[frame->ranges_begin + level_block_at(frame, b.x, b.y, b.z)] >> 8 >= frame->isovalue_index
             ? ISO_SIDE_INSIDE
             : ISO_SIDE_OUTSIDE;
}

/// Does the ray reach the border at t within the domain? If so, *b is the block it is in just behind it.
ISO_INLINE int block_at_border(const FrameParams *frame, const Ray *ray, float t, BlockCoords *b) {
  const LastPlanes last = last_planes(frame);
  LastPlanes zero;
  RayEvent enter = border_event(t), exit = border_event(INFINITY);
  zero.x = zero.y = zero.z = 0;
  if (!clip_to_box(ray, zero, last, &enter, &exit) || enter.axis != ISO_AXIS_START) return 0;
  b->x = (uint)locate(ray->x, 0, enter, 4, 0, (last.x - 1) / 4);
  b->y = (uint)locate(ray->y, 1, enter, 4, 0, (last.y - 1) / 4);
  b->z = (uint)locate(ray->z, 2, enter, 4, 0, (last.z - 1) / 4);
  return 1;
}

/// Where a ray goes on that leaves the band of frames[level]: its next block, and its side if it stands there for that; or
/// ISO_INVALID_ID. side: on which it left, or else the border is in a block that is as a whole on one. Where the block behind the border
/// is not as a whole on that side, the ray stands there; else at the next active block, in this band or one behind. ranges: of all
/// levels' blocks. found [1]: scratch.
ISO_INLINE uint cross_borders(global const FrameParams *frames, uint num_frames,
                              global const uint *macrocell_masks, global const ushort *ranges, uint pixel,
                              uint level, uint side, local uint *found) {
  uint state = ISO_INVALID_ID;
  for (; level + 1 < num_frames && state == ISO_INVALID_ID; ++level) {
    const FrameParams behind = frames[level + 1];
    const Ray ray = make_ray(&behind, pixel);
    uint block_id = first_block(&behind, &ray);
    BlockCoords b;
    if (block_id != ISO_INVALID_ID) {
      const int is_at_border = block_at_border(&behind, &ray, behind.begin_t, &b);
      if (is_at_border && side == ISO_SIDE_UNKNOWN) {
        const FrameParams before = frames[level];
        const Ray ray_before = make_ray(&before, pixel);
        BlockCoords left;
        if (block_at_border(&before, &ray_before, before.end_t, &left))
          side = side_of_block(&before, macrocell_masks, ranges, left);
      }
      if (is_at_border && side != ISO_SIDE_UNKNOWN &&
          side_of_block(&behind, macrocell_masks, ranges, b) != side) {
        state = block_id | side << ISO_RAY_SIDE_SHIFT;
      } else if (find_blocks(&behind, macrocell_masks, &ray, &block_id, 1, found, 1) != 0) {
        state = found[0];
      }
    }
    side = ISO_SIDE_UNKNOWN;
  }
  return state;
}

/// `frame`: that of the level which has block block_id, as a copy of the work-item's own.
#if ISO_LEVELS
#define ISO_FRAME_OF(frame, block_id)                                                \
  const FrameParams frame##_params = frames[level_of(frames, num_frames, block_id)]; \
  const FrameParams *frame = &frame##_params
#else
#define ISO_FRAME_OF(frame, block_id) \
  const FrameParams *frame = ((void)frames, (void)num_frames, &frame_params)
#endif

/// Begins a frame. hits [pixel], seen as words, = none; next_active_ray_ids [counts->next_active_count]: of the frame's screen
/// box, the pixels whose rays meet an active block, each with that block in ray_block_ids [pixel]. counts: of the frame's last
/// pass, next_active_count 0 before; *next: the first pass of this frame is for all rays. frames [num_frames]: with levels of detail, those
/// that draw, the finest first; frame_params is the first of them. ranges: of their blocks. A kernel of its own, since it is so much leaner than march
/// that far more of its work-items fit a device at a time. Groups stride over the tiles.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void start_rays(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const uint *macrocell_masks, global const ushort *ranges, global PassCounts *counts,
    global PassCounts *next, global uint *next_active_ray_ids, global uint *ray_block_ids,
    global uint *hit_words) {
  const FrameParams *frame = &frame_params;
  local uint found[ISO_GROUP_SIZE], counters[2];
  const PixelBox box = {frame->screen_begin_x, frame->screen_begin_y, frame->screen_end_x,
                        frame->screen_end_y};
  const uint item = get_local_id(0), num_tiled = num_tiled_pixels(box);
  if (get_global_id(0) == 0) next->window_count = num_pixels(frame);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_pixels(frame);
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    clear_hits(hit_words + begin * ISO_HIT_WORDS, min((uint)ISO_GROUP_SIZE, num_pixels(frame) - begin));
    barrier(CLK_LOCAL_MEM_FENCE); /* or each of a CPU's work-items, one by one, would go through all memory */
  }
  if (item == 0) counters[0] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_tiled;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint pixel = begin + item < num_tiled ? tiled_pixel(frame, box, begin + item) : ISO_INVALID_ID;
    uint num_found = 0, log_ahead = ISO_FIRST_LOG_AHEAD;
    if (pixel != ISO_INVALID_ID) {
      const Ray ray = make_ray(frame, pixel);
      uint block_id = first_block(frame, &ray);
      if (block_id != ISO_INVALID_ID)
        num_found = find_blocks(frame, macrocell_masks, &ray, &block_id, 1, found + item, 1);
      if (ISO_LEVELS && num_found == 0) {
        log_ahead = ISO_BORDER_LOG_AHEAD;
        found[item] = cross_borders(frames, num_frames, macrocell_masks, ranges, pixel, 0, ISO_SIDE_UNKNOWN,
                                    found + item);
        num_found = found[item] != ISO_INVALID_ID;
      }
      if (num_found != 0) ray_block_ids[pixel] = found[item];
    }
    append_ray(num_found != 0, pixel | log_ahead << ISO_RAY_AHEAD_SHIFT, counters, &counts->next_active_count,
               next_active_ray_ids);
  }
}

/// find_blocks() for a ray that stands at block *block_id, which it looks into though it may not be active where it has a side.
ISO_INLINE uint find_blocks_from(const FrameParams *frame, global const uint *macrocell_masks, const Ray *ray,
                                 uint side, uint *block_id, uint wanted, local uint *found) {
  uint first = 0;
  if (side != ISO_SIDE_UNKNOWN) {
    found[0] = *block_id;
    first = 1;
    *block_id = block_behind(frame, ray, block_coords(frame, *block_id), last_planes(frame));
    if (wanted == 1 || *block_id == ISO_INVALID_ID) return 1;
  }
  return first + find_blocks(frame, macrocell_masks, ray, block_id, wanted - first,
                             found + first * ISO_GROUP_SIZE, ISO_GROUP_SIZE);
}

/// Walks rays on until they hit, leave or wait: active_ray_ids [prev->next_active_count], each from ray_block_ids [pixel], an
/// active block. Out: hits [pixel]; next_active_ray_ids [counts->next_active_count] of those that wait, and in ray_block_ids the
/// block they wait at; *next, opened. macrocell_masks: as traverse(). frame_params, frames, ranges: as start_rays; a ray that leaves
/// the band of its level goes on behind the border.
///
/// Groups stride over the rays, in rounds: find the next blocks, walk their cells. When rays are so few that a device would
/// wait for the longest of them, each has more work-items, up to one for each block of a round; the first block in which anything
/// happens decides, which an atomic_min of its place tells.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void march(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const uint *macrocell_masks, global const ushort *ranges, global BlockEntry *table,
    global const ulong *inside, global const float *cache_values, global const PassCounts *prev,
    global PassCounts *counts, global PassCounts *next_counts, global const uint *active_ray_ids,
    global uint *next_active_ray_ids, global uint *ray_block_ids, global HitRecord *hits,
    global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  local uint slots[8 * ISO_GROUP_SIZE], found[ISO_BLOCKS_AT_ONCE * ISO_GROUP_SIZE];
  local uint counters[2], group_hits, group_blocks, num_going;
  volatile local uint deciding[ISO_GROUP_SIZE]; /* of each ray's blocks of the round */
  const uint item = get_local_id(0), num_rays = prev->next_active_count;
  const uint lanes = lanes_per_ray(num_rays);
  uint num_hits = 0, num_blocks = 0;
  if (get_global_id(0) == 0) {
    open_next_counts(frame, prev, counts, next_counts);
    open_requests(cache);
    cache->first_block_id = ISO_INVALID_ID;
    counts->active_count = num_rays;
    counts->spec_count = num_rays == 0 ? 0 : clamp(num_pixels(frame) / num_rays, 1u, frame->max_spec_count);
  }
  if (item == 0) counters[0] = group_hits = group_blocks = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_rays * lanes;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint i = (begin + item) / lanes, lane = item % lanes;
    const int is_ray = i < num_rays;
    const uint entry = is_ray ? active_ray_ids[i] : 0, pixel = entry & ISO_RAY_PIXEL;
    uint state = is_ray ? ray_block_ids[pixel] : ISO_INVALID_ID;
    uint log_ahead = entry >> ISO_RAY_AHEAD_SHIFT & 7u, doubt = entry & ISO_RAY_IN_DOUBT, turns = 1;
    int on = is_ray, waits = 0;
    while (turns != 0) { /* one for each level of detail that a ray comes through */
      const uint from = ISO_LEVELS && on ? state & ISO_RAY_BLOCK : state;
      const uint side = ISO_LEVELS && on ? state >> ISO_RAY_SIDE_SHIFT : ISO_SIDE_UNKNOWN;
      ISO_FRAME_OF(level, from);
      const LastPlanes last = last_planes(level);
      const Ray ray = make_ray(level, pixel);
      uint next = from, at = lane, more = 1, waits_as = 0, decides_at = 0;
      int result = ISO_RAY_LEFT, going = on, gone = 0, first = 1;
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
            num_found = find_blocks_from(level, macrocell_masks, &ray, first ? side : ISO_SIDE_UNKNOWN, &next,
                                         ISO_BLOCKS_AT_ONCE, found + item);
          }
          for (at = lane; at < num_found && result == ISO_RAY_LEFT; at += lanes) {
            const int stands_here = first && at == 0;
            result = march_block(level, table, inside, cache_values, &ray,
                                 block_coords(level, found[at * ISO_GROUP_SIZE + item]), last, slots + item,
                                 stands_here && doubt != 0, stands_here ? side : ISO_SIDE_UNKNOWN, &change);
            if (result == ISO_RAY_LEFT) {
              ++num_passed;
            } else {
              atomic_min(&deciding[item / lanes], at);
              decides_at = at;
              waits_as = found[at * ISO_GROUP_SIZE + item];
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
      if (result == ISO_RAY_DOUBT || result == ISO_RAY_WAITS) {
        waits = 1;
        doubt = result == ISO_RAY_DOUBT ? ISO_RAY_IN_DOUBT : 0;
        if (waits_as != from) log_ahead = min(log_ahead + 1, ISO_RAY_AHEAD_MAX);
        ray_block_ids[pixel] = ISO_LEVELS && waits_as == from ? state : waits_as;
      }
      turns = 0;
      if (ISO_LEVELS) {
        if (lane == 0) deciding[item / lanes] = ISO_INVALID_ID;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (result >= ISO_RAY_ENDS || (gone && lane == 0)) {
          const uint left_on = result == ISO_RAY_ENDS       ? ISO_SIDE_OUTSIDE
                               : result == ISO_RAY_ENDS + 1 ? ISO_SIDE_INSIDE
                                                            : ISO_SIDE_UNKNOWN;
          state = cross_borders(frames, num_frames, macrocell_masks, ranges, pixel,
                                level_of(frames, num_frames, from), left_on, found + item);
          deciding[item / lanes] = state;
          if (state != ISO_INVALID_ID) atomic_inc(&num_going);
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        state = deciding[item / lanes];
        turns = num_going;
        on = state != ISO_INVALID_ID;
        if (on) {
          log_ahead = ISO_BORDER_LOG_AHEAD;
          doubt = 0;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
      }
    }
    append_ray(waits, pixel | log_ahead << ISO_RAY_AHEAD_SHIFT | doubt, counters, &counts->next_active_count,
               next_active_ray_ids);
  }
  if (num_hits != 0) atomic_add(&group_hits, num_hits);
  if (num_blocks != 0) atomic_add(&group_blocks, num_blocks);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0 && group_hits != 0) atomic_add(&counts->hit_count, group_hits);
  if (item == 0 && group_blocks != 0) atomic_add(&counts->granted_count, group_blocks);
}

#define ISO_REQUEST_STAGING 256u  ///< requests that a work-group collects before it writes them out

/// The request list, and where a work-group collects what it will add to it.
typedef struct Requests {
  global uint *bits, *block_ids;
  uint capacity;
  volatile global uint *count;
  local uint *staged;
  volatile local uint *num_staged;
} Requests;

/// Asks for those of the given corners of the dual grid of block b that are not cached; stamps the others. In steps for all
/// corners, so that a GPU waits for memory twice, not sixteen times. Most have been asked for by another ray: their bits tell,
/// and cost neither a search in the table nor an atomic, for whose result one would wait.
ISO_INLINE void request_touched(const FrameParams *frame, global const BlockEntry *table,
                                global uint *slot_stamps, uint pass, BlockCoords b, uint touched,
                                Requests requests) {
  BlockEntry entries[8];
  uint missing = touched; /* of the corners: nobody is known to have asked for them */
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
    const uint word = (touched >> corner & 1u) != 0 ? request_word(frame, x, y, z) : 0;
    const uint bits = ISO_CHECK_RACES ? atomic_or(&requests.bits[word], 0u) : requests.bits[word];
    missing &= ~((uint)((bits & request_bit(frame, x, y, z)) != 0) << corner);
  }
  if (missing == 0) return;
  find_dual_grid(frame, table, b.x, b.y, b.z, entries);
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    if ((missing >> corner & 1u) != 0 && entries[corner].slot != ISO_BLOCK_ABSENT) {
      slot_stamps[entries[corner].slot] = pass;
      missing &= ~(1u << corner);
    }
  }
  for (uint corner = 0; corner < 8; ++corner) {
    const uint x = b.x + (corner & 1), y = b.y + (corner >> 1 & 1), z = b.z + (corner >> 2);
    if ((missing >> corner & 1u) != 0 && mark_request(frame, requests.bits, x, y, z)) {
      const uint block_id = block_id_at(frame, x, y, z), place = atomic_inc(requests.num_staged);
      if (place < ISO_REQUEST_STAGING) {
        requests.staged[place] = block_id;
      } else {
        list_request(frame, requests.block_ids, requests.capacity, requests.bits, atomic_inc(requests.count),
                     block_id);
      }
    }
  }
}

/// Of the rays that wait, active_ray_ids [counts->next_active_count], the first counts->window_count ask for the blocks that
/// they touch in their next active blocks: N_Spec of them (Sec. 4), or their own number of frame->per_ray_speculation. Out:
/// request_block_ids [counts->requested_count, at most capacity]. The other arguments as in march. Groups stride over the rays; when these are few, each has
/// more work-items, which share its blocks out among them.
kernel __attribute__((reqd_work_group_size(ISO_GROUP_SIZE, 1, 1))) void request_ahead(
    const FrameParams frame_params, global const FrameParams *frames, uint num_frames,
    global const uint *macrocell_masks, global const ushort *ranges, global const BlockEntry *table,
    global PassCounts *counts, global const uint *active_ray_ids, global const uint *ray_block_ids,
    global uint *slot_stamps, global uint *requested_bits, global uint *request_block_ids, uint capacity,
    global CacheState *cache) {
  const FrameParams *frame = &frame_params;
  local uint found[ISO_BLOCKS_AT_ONCE * ISO_GROUP_SIZE], staged[ISO_REQUEST_STAGING];
  local uint num_staged, list_begin;
  const Requests requests = {requested_bits, request_block_ids, capacity, &counts->requested_count,
                             staged,         &num_staged};
  const uint item = get_local_id(0), num_rays = min(counts->next_active_count, counts->window_count);
  const uint lanes = lanes_per_ray(num_rays);
  if (item == 0) num_staged = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint begin = get_group_id(0) * ISO_GROUP_SIZE; begin < num_rays * lanes;
       begin += get_num_groups(0) * ISO_GROUP_SIZE) {
    const uint i = (begin + item) / lanes, lane = (begin + item) % lanes;
    if (i < num_rays) {
      const uint entry = active_ray_ids[i], pixel = entry & ISO_RAY_PIXEL;
      uint state = ray_block_ids[pixel]; /* it stands at an active block, or where it has a side */
      /* A new ray does not look behind the border: most hit before it. */
      const int has_moved_on = (entry >> ISO_RAY_AHEAD_SHIFT & 7u) > ISO_FIRST_LOG_AHEAD;
      const uint own = min(1u << (entry >> ISO_RAY_AHEAD_SHIFT & 7u), frame->max_spec_count);
      /* Where rays are few, all look further: the last ones take fewer passes, and decode hardly more. */
      const uint ahead = frame->per_ray_speculation ? max(own, counts->spec_count / 2) : counts->spec_count;
      for (uint asked = 0; asked < ahead && state != ISO_INVALID_ID;) { /* level by level */
        const uint from = ISO_LEVELS ? state & ISO_RAY_BLOCK : state;
        uint next = from, side = ISO_LEVELS ? state >> ISO_RAY_SIDE_SHIFT : ISO_SIDE_UNKNOWN;
        ISO_FRAME_OF(level, from);
        const LastPlanes last = last_planes(level);
        const Ray ray = make_ray(level, pixel);
        while (asked < ahead && next != ISO_INVALID_ID) {
          const uint num_found = find_blocks_from(level, macrocell_masks, &ray, side, &next,
                                                  min(ahead - asked, ISO_BLOCKS_AT_ONCE), found + item);
          side = ISO_SIDE_UNKNOWN;
          for (uint at = lane; at < num_found; at += lanes) { /* all lanes at once */
            const uint block_id = found[at * ISO_GROUP_SIZE + item];
            const BlockCoords b = block_coords(level, block_id);
            const uint touched = touched_blocks(&ray, (int)b.x, (int)b.y, (int)b.z, last);
            request_touched(level, table, slot_stamps, counts->pass, b, touched, requests);
            if (i == 0 && asked + at == 0) {
              cache->first_block_id = block_id;
              cache->first_touched = touched;
            }
          }
          asked += num_found;
        }
        state = ISO_INVALID_ID;
        if (ISO_LEVELS && asked < ahead && has_moved_on)
          state = cross_borders(frames, num_frames, macrocell_masks, ranges, pixel,
                                level_of(frames, num_frames, from), ISO_SIDE_UNKNOWN, found + item);
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) list_begin = atomic_add(requests.count, min(num_staged, ISO_REQUEST_STAGING));
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint j = item; j < min(num_staged, ISO_REQUEST_STAGING); j += ISO_GROUP_SIZE) {
      list_request(frame, request_block_ids, capacity, requested_bits, list_begin + j, staged[j]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) num_staged = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
