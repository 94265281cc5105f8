/// march_block.h -- a ray through the cells of a block whose dual grid is in the cache, as far as
/// it is (march.cl). OpenCL C 1.2.
#ifndef ISOWAVE_MARCH_BLOCK_H
#define ISOWAVE_MARCH_BLOCK_H

#include "block_walk.h"
#include "portable/block_cells.h"
#include "portable/block_table.h"
#include "portable/cell_intersect.h"
#include "portable/clip.h"
#include "portable/layers.h"
#include "slot_values.h"

/// The cache (block_cache.cl), as a work-item looks into it.
typedef struct CacheReader {
  global const uint *table;
  global const ulong *inside;
  global ulong *changing;
  global const SlotValue *values;
  global uint *slot_stamps;
  uint stamp;  ///< read_stamp() of the pass: the stamp of every cached block that is opened
  ISO_SCRATCH uint *slots;  ///< for the slots of a dual grid: 8, ISO_SCRATCH_STRIDE apart
} CacheReader;

/// The end of a ray's way through a block.
#define ISO_RAY_LEFT 0          ///< it left the block, or the volume
#define ISO_RAY_HIT 1           ///< equal to what isolate() returns, as is
#define ISO_RAY_DOUBT 2         ///< the next march settles it
#define ISO_RAY_WAITS 3         ///< for a block that is not cached
#define ISO_RAY_ENDS_OUTSIDE 4  ///< its interval ends here
#define ISO_RAY_ENDS_INSIDE 5
#define ISO_RAY_ENDS 6  ///< the same, on neither side, or on which does not matter
#if ISO_RAY_DOUBT != ISO_DOUBTFUL
#error "a result of isolate() must stand for itself"
#endif

/// The corners of the dual grid (bits 0..7, corner x + 2y + 4z) whose blocks the voxels of local
/// cell (x,y,z) lie in.
ISO_INLINE uint cell_blocks(int x, int y, int z) {
  const int border = (x == 3 ? 1 : 0) + (y == 3 ? 2 : 0) + (z == 3 ? 4 : 0);
  return (uint)(0xFF5533110F050301ul >> (8 * border)) & 0xFFu;
}

/// A change of inside, or doubt, in a cell of a block.
typedef struct BlockChange {
  CellChange change;
  CellWalk at;
  float w[8];
  int at_border;  ///< the change is where the ray begins: two levels disagree, or it is a cap
  uint number;    ///< of the change among those in its cell
} BlockChange;

ISO_INLINE int changes_at_border(const BlockChange *found) {
  return ISO_INTERVALS && found->at_border;
}

/// The cells of a block that have voxels of any of those corners.
ISO_INLINE ulong cells_of_corners(uint corners) {
  const ulong x3 = 0x8888888888888888ul, y3 = 0xF000F000F000F000ul, z3 = 0xFFFF000000000000ul;
  ulong cells = 0;
  for (uint corner = 0; corner < 8; ++corner) {
    if ((corners >> corner & 1u) != 0)
      cells |= ((corner & 1) != 0 ? x3 : ~0ul) & ((corner & 2) != 0 ? y3 : ~0ul) &
               ((corner & 4) != 0 ? z3 : ~0ul);
  }
  return cells;
}

/// The cells of block b that a ray must look into: those in which inside changes, and those that
/// need a block that is not cached. The cells are kept with the block's slot for the next ray.
///
/// Out  cache->slots; *have: which corners of the dual grid are cached, or beyond the volume, where
///      no cell of the domain reaches
ISO_INLINE ulong open_block(const FrameParams *frame, const CacheReader *cache, BlockCoords b,
                            uint *have) {
  uint slots[8];
  ulong cells = 0;
  find_dual_grid(frame, cache->table, b.x, b.y, b.z, slots);
  *have = (b.x + 1 == frame->grid.blocks_x ? 0xAAu : 0u) |
          (b.y + 1 == frame->grid.blocks_y ? 0xCCu : 0u) |
          (b.z + 1 == frame->grid.blocks_z ? 0xF0u : 0u);
  ISO_UNROLL
  for (uint corner = 0; corner < 8; ++corner) {
    cache->slots[corner * ISO_SCRATCH_STRIDE] = slots[corner];
    *have |= (uint)(slots[corner] != ISO_BLOCK_ABSENT) << corner;
  }
  if ((*have & 1u) != 0) cells = cache->changing[slots[0]];
  if (cells == ISO_CHANGING_UNKNOWN) {
    ulong voxels[8];
    ISO_UNROLL
    for (uint corner = 0; corner < 8; ++corner) {
      const uint slot = slots[corner];
      voxels[corner] = slot == ISO_BLOCK_ABSENT ? 0 : cache->inside[slot];
    }
    cells = changing_cells(voxels) | cells_of_corners(~*have & 0xFFu);
    if (!ISO_CHECK_RACES && *have == 0xFFu) cache->changing[slots[0]] = cells;
  }
  return cells;
}

/// Stamps the block that was opened last, for all of its dual grid: last_use() in slot_stamps.h.
ISO_INLINE void stamp_block(const CacheReader *cache) {
  cache->slot_stamps[cache->slots[0]] = cache->stamp;
}

/// Does a ray that ends here say on which side it is?
ISO_INLINE int tells_side(int ends) {
  return ISO_BANDS && ends;
}

/// Finds change number found->number of inside in a cell. Kernels whose rays do not go on behind
/// hits find the first.
///
/// precise  as march_block()
ISO_INLINE int find_change(const Ray *ray, const GridWalk *cell, RayEvent exit, int precise,
                           BlockChange *found) {
#if ISO_BEHIND_HITS
  return numbered_change_in_cell(ray, found->w, cell->x, cell->y, cell->z, found->at.enter, exit,
                                 found->number, precise, &found->change);
#else
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  return precise ? change_in_cell(solver, ray, found->w, cell->x, cell->y, cell->z, found->at.enter,
                                  exit, &found->change)
                 : change_or_doubt_in_cell(solver, ray, found->w, cell->x, cell->y, cell->z,
                                           found->at.enter, exit, &found->change);
#endif
}

/// The ray's way through the cells of block b behind a hit in it, which has HitRecord::cell `cell`.
ISO_INLINE CellWalk start_at_hit(const Ray *ray, BlockCoords b, uint cell, LastPlanes last) {
  const int x = (int)(4 * b.x + (cell & 3u)), y = (int)(4 * b.y + (cell >> 2 & 3u)),
            z = (int)(4 * b.z + (cell >> 4 & 3u));
  return start_at_cell(ray, x, y, z, ray_entry(ray, region_entry(ray, x, y, z, 1, last)), last);
}

/// Walks the cells of block b, and stamps it if it is cached.
///
/// precise  doubts are settled on the spot
/// side     where the ray was before it begins in this block, or ISO_AT_HIT
/// hit_cell HitRecord::cell of the hit that the ray then stands at
/// may_end  the ray may end in this block
/// Returns  ISO_RAY_LEFT (the block), ISO_RAY_HIT, ISO_RAY_DOUBT, ISO_RAY_WAITS if a block of the
///          dual grid is not cached, or how the ray ends
ISO_LONG int march_block(const FrameParams *frame, const CacheReader *cache, const Ray *ray,
                         LastPlanes last, BlockCoords b, int precise, uint side, uint hit_cell,
                         int may_end, BlockChange *found) {
  uint have; /* corners of the dual grid */
  int result = ISO_RAY_LEFT;
  const ulong cells = open_block(frame, cache, b, &have);
  if ((have & 1u) == 0) return ISO_RAY_WAITS;
  stamp_block(cache);
  const GridWalk block = walk_from(ray, (int)b.x, (int)b.y, (int)b.z, 4, last);
  const int ends = may_end && ends_ray(ray, walk_exit(&block, ray));
  if (cells == 0 && !has_side(side) && !tells_side(ends)) return ISO_RAY_LEFT;
  const GridWalk *cell = &found->at.cell;
  if (is_at_hit(side)) {
    found->at = start_at_hit(ray, b, hit_cell, last);
  } else {
    const RayEvent enter = ray_entry(ray, region_entry(ray, (int)b.x, (int)b.y, (int)b.z, 4, last));
    found->at = enter_cells(ray, b, enter, last);
  }
  found->at_border = 0;
  found->number = is_at_hit(side) ? crossings_up_to_cell(hit_cell) : 0u;
  do {
    const int x = cell->x & 3, y = cell->y & 3, z = cell->z & 3;
    const int ends_here = ends && ends_ray(ray, found->at.exit);
    const RayEvent exit = ends_here ? ray_end(ray) : found->at.exit;
    if ((cells >> cell_in_block(cell) & 1ul) != 0 || has_side(side) || tells_side(ends_here)) {
      if ((cell_blocks(x, y, z) & ~have) != 0) {
        result = ISO_RAY_WAITS;
      } else {
        for (int corner = 0; corner < 8; ++corner) {
          const int vx = x + (corner & 1), vy = y + (corner >> 1 & 1), vz = z + (corner >> 2);
          const uint slot =
              cache->slots[((vx >> 2) + 2 * (vy >> 2) + 4 * (vz >> 2)) * ISO_SCRATCH_STRIDE];
          found->w[corner] =
              field_of_slot(frame, cache->values[slot * ISO_BLOCK_VOXELS +
                                                 (uint)((vx & 3) + 4 * (vy & 3) + 16 * (vz & 3))]) -
              frame->surface.isovalue;
        }
        if (has_side(side))
          found->at_border = inside_at(ray, found->w, found->at.enter, cell->x, cell->y, cell->z,
                                       0) != (side == ISO_SIDE_INSIDE);
        result =
            changes_at_border(found) ? ISO_RAY_HIT : find_change(ray, cell, exit, precise, found);
        if (result == ISO_RAY_LEFT && tells_side(ends_here))
          result = ISO_NO_DATA && lacks_data(found->w) ? ISO_RAY_ENDS
                   : inside_at(ray, found->w, exit, cell->x, cell->y, cell->z, 1)
                       ? ISO_RAY_ENDS_INSIDE
                       : ISO_RAY_ENDS_OUTSIDE;
      }
    }
    if (result == ISO_RAY_LEFT && ends_here) result = ISO_RAY_ENDS;
    side = ISO_SIDE_UNKNOWN;
    if (result == ISO_RAY_LEFT) found->number = 0;
  } while (result == ISO_RAY_LEFT && next_cell(&found->at, ray, last));
  return result;
}

/// Does a ray with this result leave the band of its level? gone: there is no active block left for
/// it there.
ISO_INLINE int leaves_band(int result, int gone) {
  return ISO_BANDS && (gone || result == ISO_RAY_ENDS_OUTSIDE || result == ISO_RAY_ENDS_INSIDE ||
                       result == ISO_RAY_ENDS);
}

/// On which side it leaves.
ISO_INLINE uint leaves_on(int result) {
  return result == ISO_RAY_ENDS_OUTSIDE  ? ISO_SIDE_OUTSIDE
         : result == ISO_RAY_ENDS_INSIDE ? ISO_SIDE_INSIDE
                                         : ISO_SIDE_UNKNOWN;
}

ISO_LONG HitRecord hit_of(const FrameParams *frame, global const ClipParams *clip, const Ray *ray,
                          const BlockChange *found) {
  const Solver solver = {ISO_SOLVER, ISO_ROOT_STEPS};
  const float s =
      changes_at_border(found) ? 0.0f : refine(solver, found->change.cubic, found->change.bracket);
  HitRecord hit = make_hit(frame, ray, found->w, found->at.cell.x, found->at.cell.y,
                           found->at.cell.z, found->at.enter, ray_exit(ray, found->at.exit), s);
  if (changes_at_border(found)) {
    mark_beginning(clip, ray, &hit);
  } else if (ISO_BEHIND_HITS) {
    hit.cell |= found->number << ISO_CROSSING_BIT;
  }
  return hit;
}

#endif
