// Ids of blocks count on through all levels of detail. Before anything is included.
#define ISO_LEVELS 1
#include "core/host/host_loops.hpp"

#include <bit>

#include "core/frame/solvers.hpp"
#include "core/host/host_packets.hpp"
#include "kernels_cl/portable/block_cells.h"
#include "kernels_cl/portable/cell_intersect.h"
#include "kernels_cl/portable/level_border.h"
#include "kernels_cl/portable/ray_state.h"
#include "kernels_cl/portable/smooth_gradient.h"
#include "kernels_cl/portable/whole_number.h"
#include "kernels_cl/portable/zfp_codec.h"

// All that a loop calls becomes part of it, and so is compiled for the processor that it is for.
#define ISO_WHOLE_LOOP __attribute__((flatten))
#define ISO_OF_ITS_OWN __attribute__((noinline))
#if defined(__x86_64__)
#include <immintrin.h>
#define ISO_HAS_WIDE_LOOPS 1
#define ISO_WIDE_LOOP __attribute__((flatten, target("avx2,bmi,bmi2,fma,popcnt")))
#endif

namespace isowave::core {

namespace {

inline void decode(const EncodedBlock &block, float *values) {
  zfp_decode_any_block(block.words, block.first_bit, block.num_bits, block.min_exponent, values);
  if (block.least <= block.greatest) {
    for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
      values[v] = whole_number(values[v], block.least, block.greatest);
  }
  if (block.no_data == 0) return;
  for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v) {
    if ((block.no_data >> v & 1u) != 0) values[v] = NAN;
  }
}

inline void widen(BlockRange &range, const BlockRange &by) {
  range.min = by.min < range.min ? by.min : range.min;
  range.max = by.max > range.max ? by.max : range.max;
}

inline void ranges_of_parts(const float *values, uint size_x, uint size_y, uint size_z,
                            BlockRange *parts) {
  constexpr BlockRange kNothing = {INFINITY, -INFINITY}; /* NaN widens no range */
  for (uint part = 0; part < 8; ++part) parts[part] = kNothing;
  for (uint z = 0; z < size_z; ++z) {
    for (uint y = 0; y < size_y; ++y) {
      const float *row = values + 4 * y + 16 * z;
      const BlockRange first = {row[0], row[0]};
      BlockRange all = kNothing;
      for (uint x = 0; x < size_x; ++x) widen(all, {row[x], row[x]});
      for (uint layers = 0; layers < 8; layers += 2) {
        if (((layers & 2) != 0 && y != 0) || ((layers & 4) != 0 && z != 0)) continue;
        widen(parts[layers], all);
        widen(parts[layers + 1], first);
      }
    }
  }
}

/// Whole blocks have a loop of their own, which compilers unroll.
inline void ranges(const EncodedBlock &block, BlockRange *parts) {
  float values[ISO_BLOCK_VOXELS];
  decode(block, values);
  if (block.size_x == 4 && block.size_y == 4 && block.size_z == 4) {
    ranges_of_parts(values, 4, 4, 4, parts);
  } else {
    ranges_of_parts(values, block.size_x, block.size_y, block.size_z, parts);
  }
}

inline ulong inside(const float *values, float isovalue) {
  ulong bits = 0;
  for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
    bits |= static_cast<ulong>(values[v] - isovalue >= 0.0f) << v;
  return bits;
}

inline float voxel_at(const FrameParams &frame, const HostField &field, int x, int y, int z) {
  const auto vx = static_cast<uint>(x), vy = static_cast<uint>(y), vz = static_cast<uint>(z);
  const ulong block = level_block_at(&frame, vx >> 2, vy >> 2, vz >> 2);
  return field.values[block * ISO_BLOCK_VOXELS + (vx & 3) + 4 * (vy & 3) + 16 * (vz & 3)];
}

/// The corners of dual cell (x,y,z) minus the isovalue, corner x + 2y + 4z.
inline void load_corners(const FrameParams &frame, const HostField &field, int x, int y, int z,
                         float *w) {
  for (int corner = 0; corner < 8; ++corner) {
    w[corner] = voxel_at(frame, field, x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)) -
                frame.surface.isovalue;
  }
}

/// Decodes the blocks that the voxels of a smooth gradient are in.
inline void decode_stencil(const FrameParams &frame, const HostField &field, const Stencil &s) {
  const BlockCoords base = stencil_base(&s);
  const uint corners = stencil_blocks(&s);
  std::size_t blocks[8], num_blocks = 0;
  bool all_decoded = true;
  for (uint corner = 0; corner < 8; ++corner) {
    if ((corners >> corner & 1u) == 0) continue;
    const std::size_t block = level_block_at(&frame, base.x + (corner & 1),
                                             base.y + (corner >> 1 & 1), base.z + (corner >> 2));
    blocks[num_blocks++] = block;
    all_decoded = all_decoded && field.is_decoded(block);
  }
  if (!all_decoded) field.maker->decode({blocks, num_blocks});
}

/// Is it a hit in this level of detail?
inline bool is_hit_of(const FrameParams &frame, const HitRecord &hit) {
  return hit.t != INFINITY && level_block_of(&frame, hit.block_id) != ISO_INVALID_ID;
}

/// Gives a hit the smooth gradient, if there is one.
inline void smooth_gradient(const FrameParams &frame, const HostField &field, LastPlanes last,
                            HitRecord *hit) {
  const Stencil s = stencil_of(block_coords(&frame, hit->block_id), hit->cell, last);
  decode_stencil(frame, field, s);
  const StencilAxis axes[3] = {s.x, s.y, s.z};
  float corners[8], beyond[8], derivatives[3];
  for (uint axis = 0; axis < 3; ++axis) {
    for (int corner = 0; corner < 8; ++corner) {
      int at[3] = {s.x.cell + (corner & 1), s.y.cell + (corner >> 1 & 1), s.z.cell + (corner >> 2)};
      corners[corner] = voxel_at(frame, field, at[0], at[1], at[2]);
      at[axis] = (corner >> axis & 1) != 0 ? axes[axis].above : axes[axis].below;
      beyond[corner] = voxel_at(frame, field, at[0], at[1], at[2]);
    }
    derivatives[axis] =
        smooth_derivative(corners, beyond, 1u << axis, axes[axis], {hit->x, hit->y, hit->z});
  }
  if (is_no_gradient({derivatives[0], derivatives[1], derivatives[2]})) return;
  hit->grad_x = derivatives[0];
  hit->grad_y = derivatives[1];
  hit->grad_z = derivatives[2];
}

/// The first hit of a ray in a block's changing cells, before its band ends. enter: by which it
/// enters the block.
inline bool trace_block(const FrameParams &frame, const HostField &field, const Ray &ray,
                        const GridWalk &block, RayEvent enter, LastPlanes last, HitRecord *hit) {
  const BlockCoords b = {static_cast<uint>(block.x), static_cast<uint>(block.y),
                         static_cast<uint>(block.z)};
  const std::size_t block_number = level_block_at(&frame, b.x, b.y, b.z);
  field.open(block_number);
  const ulong changing = field.changing[block_number];
  CellWalk at = enter_cells(&ray, b, enter, last);
  do {
    if (passes_border(at.exit, frame.band.end_t)) at.exit = border_event(frame.band.end_t);
    if ((changing >> cell_in_block(&at.cell) & 1u) == 0) continue;
    const int x = at.cell.x, y = at.cell.y, z = at.cell.z;
    float w[8];
    CellChange change;
    load_corners(frame, field, x, y, z, w);
    if (!change_in_cell(kDefaultSolver, &ray, w, x, y, z, at.enter, at.exit, &change)) continue;
    *hit = make_hit(&frame, &ray, w, x, y, z, at.enter, at.exit,
                    refine(kDefaultSolver, change.cubic, change.bracket));
    return true;
  } while (at.exit.axis != ISO_AXIS_START && next_cell(&at, &ray, last));
  return false;
}

/// The block of a macrocell that the ray is in just after `enter`, by which it entered that.
inline GridWalk enter_macrocell(const Ray &ray, const GridWalk &macrocell, RayEvent enter,
                                LastPlanes last) {
  const auto block = [&](RayAxis a, int axis, int coarse, int last_plane) {
    const int first = coarse * ISO_MACROCELL_BLOCKS, end = first + ISO_MACROCELL_BLOCKS - 1,
              domain_end = (last_plane - 1) / 4;
    return locate(a, axis, enter, 4, first, end < domain_end ? end : domain_end);
  };
  return walk_from(&ray, block(ray.x, 0, macrocell.x, last.x), block(ray.y, 1, macrocell.y, last.y),
                   block(ray.z, 2, macrocell.z, last.z), 4, last);
}

/// The box of active blocks.
struct ActiveBox {
  LastPlanes begin, end;    ///< planes
  LastPlanes first, final;  ///< macrocells
};

inline ActiveBox active_box(const Surface &surface, LastPlanes last) {
  const auto end = [](int blocks, int last_plane) {
    return 4 * blocks < last_plane ? 4 * blocks : last_plane;
  };
  constexpr int kBlocks = ISO_MACROCELL_BLOCKS;
  return {{4 * surface.active_begin_x, 4 * surface.active_begin_y, 4 * surface.active_begin_z},
          {end(surface.active_end_x, last.x), end(surface.active_end_y, last.y),
           end(surface.active_end_z, last.z)},
          {surface.active_begin_x / kBlocks, surface.active_begin_y / kBlocks,
           surface.active_begin_z / kBlocks},
          {(surface.active_end_x - 1) / kBlocks, (surface.active_end_y - 1) / kBlocks,
           (surface.active_end_z - 1) / kBlocks}};
}

/// The first hit of a ray in the band of a level. Walks from macrocell to macrocell, in those with
/// an active block from block to block, and in active blocks from cell to cell.
inline bool walk_ray(const FrameParams &frame, const HostField &field, const ActiveBox &box,
                     LastPlanes last, const Ray &ray, HitRecord *hit) {
  constexpr int kVoxels = 4 * ISO_MACROCELL_BLOCKS;
  const uint columns = (frame.grid.blocks_x + 3) / 4, rows = (frame.grid.blocks_y + 3) / 4;
  RayEvent enter = border_event(frame.band.begin_t), exit = border_event(frame.band.end_t);
  if (!clip_to_box(&ray, box.begin, box.end, &enter, &exit)) return false;
  GridWalk coarse =
      walk_from(&ray, locate(ray.x, 0, enter, kVoxels, box.first.x, box.final.x),
                locate(ray.y, 1, enter, kVoxels, box.first.y, box.final.y),
                locate(ray.z, 2, enter, kVoxels, box.first.z, box.final.z), kVoxels, last);
  while (coarse.x >= box.first.x && coarse.x <= box.final.x && coarse.y >= box.first.y &&
         coarse.y <= box.final.y && coarse.z >= box.first.z && coarse.z <= box.final.z) {
    const ulong mask =
        field.masks[static_cast<ulong>(coarse.x) +
                    columns * (static_cast<ulong>(coarse.y) +
                               static_cast<ulong>(rows) * static_cast<ulong>(coarse.z))];
    if (mask == 0) {
      exit = walk_exit(&coarse, &ray);
      if (passes_border(exit, frame.band.end_t)) return false;
    } else {
      GridWalk block = enter_macrocell(ray, coarse, enter, last);
      for (bool left = false; !left; enter = exit) {
        if ((mask >> cell_in_block(&block) & 1u) != 0 &&
            trace_block(frame, field, ray, block, enter, last, hit))
          return true;
        exit = walk_exit(&block, &ray);
        if (passes_border(exit, frame.band.end_t)) return false;
        left = leaves(&block, &coarse, exit) != 0;
        walk_step(&block, &ray, exit, 4, last);
      }
    }
    walk_step(&coarse, &ray, exit, kVoxels, last);
    enter = exit;
  }
  return false;
}

// Three loops trace rays: each calls this, which is long.
ISO_OF_ITS_OWN ISO_WHOLE_LOOP bool trace_ray_anywhere(const FrameParams &frame,
                                                      const HostField &field, const ActiveBox &box,
                                                      LastPlanes last, const Ray &ray,
                                                      HitRecord *hit) {
  return walk_ray(frame, field, box, last, ray, hit);
}
#ifdef ISO_HAS_WIDE_LOOPS
ISO_OF_ITS_OWN ISO_WIDE_LOOP bool trace_ray_wide(const FrameParams &frame, const HostField &field,
                                                 const ActiveBox &box, LastPlanes last,
                                                 const Ray &ray, HitRecord *hit) {
  return walk_ray(frame, field, box, last, ray, hit);
}
#endif

/// The side on which a whole block is; unknown if it may have cells that change.
inline uint side_of_block(const FrameParams &frame, const HostField &field, BlockCoords b) {
  constexpr uint kBlocks = ISO_MACROCELL_BLOCKS;
  const uint columns = (frame.grid.blocks_x + 3) / 4, rows = (frame.grid.blocks_y + 3) / 4;
  const ulong macrocell =
      b.x / kBlocks + columns * (b.y / kBlocks + static_cast<ulong>(rows) * (b.z / kBlocks));
  const uint bit = b.x % kBlocks + 4 * (b.y % kBlocks) + 16 * (b.z % kBlocks);
  if (field.has_gaps || (field.masks[macrocell] >> bit & 1u) != 0) return ISO_SIDE_UNKNOWN;
  return field.highs[64 * macrocell + bit] - frame.surface.isovalue >= 0.0f ? ISO_SIDE_INSIDE
                                                                            : ISO_SIDE_OUTSIDE;
}

/// Decodes a cell.
inline void open_cell(const HostLevel &level, BlockCoords cell, float *w) {
  level.field.open(level_block_at(&level.frame, cell.x >> 2, cell.y >> 2, cell.z >> 2));
  load_corners(level.frame, level.field, static_cast<int>(cell.x), static_cast<int>(cell.y),
               static_cast<int>(cell.z), w);
}

/// The side on which a ray is at the border at t, which is in *cell; unknown if it does not come to
/// the border, or is in a cell without data there.
inline uint side_at_border(const HostLevel &level, const Ray &ray, LastPlanes last, float t,
                           BlockCoords *cell) {
  if (!reaches_border(&ray, last, t)) return ISO_SIDE_UNKNOWN;
  *cell = region_at_border(&ray, last, t, 1);
  const uint side =
      side_of_block(level.frame, level.field, {cell->x >> 2, cell->y >> 2, cell->z >> 2});
  if (side != ISO_SIDE_UNKNOWN) return side;
  float w[8];
  open_cell(level, *cell, w);
  if (lacks_data(w)) return ISO_SIDE_UNKNOWN;
  return inside_at(&ray, w, border_event(t), static_cast<int>(cell->x), static_cast<int>(cell->y),
                   static_cast<int>(cell->z), 0)
             ? ISO_SIDE_INSIDE
             : ISO_SIDE_OUTSIDE;
}

/// The hit of a ray at the border at which its band begins, in that cell.
inline HitRecord hit_at_border(const HostLevel &level, const Ray &ray, LastPlanes last,
                               BlockCoords cell) {
  const FrameParams &frame = level.frame;
  const int x = static_cast<int>(cell.x), y = static_cast<int>(cell.y),
            z = static_cast<int>(cell.z);
  const GridWalk walk = walk_from(&ray, x, y, z, 1, last);
  const RayEvent exit = walk_exit(&walk, &ray);
  float w[8];
  open_cell(level, cell, w);
  return make_hit(&frame, &ray, w, x, y, z, border_event(frame.band.begin_t),
                  passes_border(exit, frame.band.end_t) ? border_event(frame.band.end_t) : exit,
                  0.0f);
}

ISO_OF_ITS_OWN ISO_WHOLE_LOOP uint side_anywhere(const HostLevel &level, const Ray &ray,
                                                 LastPlanes last, float t, BlockCoords *cell) {
  return side_at_border(level, ray, last, t, cell);
}
#ifdef ISO_HAS_WIDE_LOOPS
ISO_OF_ITS_OWN ISO_WIDE_LOOP uint side_wide(const HostLevel &level, const Ray &ray, LastPlanes last,
                                            float t, BlockCoords *cell) {
  return side_at_border(level, ray, last, t, cell);
}
#endif

/// The first hit of a ray, from band to band. If two levels have it on different sides of the
/// surface, it hits at their border.
template <auto kTraceRay, auto kSide>
inline bool trace_bands(std::span<const HostLevel> levels, uint ray_id, HitRecord *hit) {
  uint before = ISO_SIDE_UNKNOWN;
  for (const HostLevel &level : levels) {
    const LastPlanes last = last_planes(&level.frame);
    const Ray ray = make_ray(&level.frame, ray_id);
    BlockCoords cell;
    if (before != ISO_SIDE_UNKNOWN) {
      const uint side = kSide(level, ray, last, level.frame.band.begin_t, &cell);
      if (side != ISO_SIDE_UNKNOWN && side != before) {
        *hit = hit_at_border(level, ray, last, cell);
        return true;
      }
    }
    const ActiveBox box = active_box(level.frame.surface, last);
    if (kTraceRay(level.frame, level.field, box, last, ray, hit)) return true;
    if (&level != &levels.back()) before = kSide(level, ray, last, level.frame.band.end_t, &cell);
  }
  return false;
}

/// Gives the hits of a tile in a level of detail smooth gradients.
inline void smooth(const FrameParams &frame, const HostField &field, const RayTile &tile,
                   HitRecord *hits) {
  const LastPlanes last = last_planes(&frame);
  for (uint y = tile.begin_y; y < tile.end_y; ++y) {
    for (uint x = tile.begin_x; x < tile.end_x; ++x) {
      HitRecord *hit = hits + x + frame.view.width * y;
      if (is_hit_of(frame, *hit)) smooth_gradient(frame, field, last, hit);
    }
  }
}

inline void smooth_levels(std::span<const HostLevel> levels, const RayTile &tile, HitRecord *hits) {
  for (const HostLevel &level : levels) smooth(level.frame, level.field, tile, hits);
}

template <auto kTraceRay, auto kSide>
inline uint trace_rays_of_levels(std::span<const HostLevel> levels, const RayTile &tile,
                                 bool is_smooth, HitRecord *hits) {
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; ++y) {
    for (uint x = tile.begin_x; x < tile.end_x; ++x) {
      const uint ray_id = x + levels.front().frame.view.width * y;
      num_hits += trace_bands<kTraceRay, kSide>(levels, ray_id, hits + ray_id);
    }
  }
  if (is_smooth && num_hits != 0) smooth_levels(levels, tile, hits);
  return num_hits;
}

#ifdef ISO_HAS_WIDE_LOOPS
/// Eight rays of a frame: 4 columns and 2 rows from (x, y) on.
struct RayPacket {
  uint x, y;
  uint lanes;       ///< bit column + 4 row: the rays that have no hit yet
  uchar before[8];  ///< where they were at the end of the last band
  BandSides sides;  ///< of this band

  uint ray_id(const FrameParams &frame, uint lane) const {
    return x + lane % 4 + frame.view.width * (y + lane / 4);
  }
};

/// Lets rays hit at the border at which a level's band begins, if the level before has them on the
/// other side of the surface. Returns these rays.
template <auto kSide>
inline uint hit_at_borders(const HostLevel &level, const RayPacket &packet, HitRecord *hits) {
  const LastPlanes last = last_planes(&level.frame);
  uint found = 0;
  for (uint left = packet.lanes; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(left));
    const uint before = packet.before[lane], at_begin = packet.sides.at_begin[lane];
    if (before == ISO_SIDE_UNKNOWN || at_begin == ISO_SIDE_UNKNOWN || at_begin == before) continue;
    const uint ray_id = packet.ray_id(level.frame, lane);
    const Ray ray = make_ray(&level.frame, ray_id);
    BlockCoords cell;
    const uint side = kSide(level, ray, last, level.frame.band.begin_t, &cell);
    if (side == ISO_SIDE_UNKNOWN || side == before) continue;
    hits[ray_id] = hit_at_border(level, ray, last, cell);
    found |= 1u << lane;
  }
  return found;
}

/// packet.before = where the rays are at the end of a level's band.
template <auto kSide>
inline void end_band(const HostLevel &level, RayPacket &packet) {
  for (uint left = packet.lanes; left != 0; left &= left - 1) {
    const auto lane = static_cast<uint>(std::countr_zero(left));
    packet.before[lane] = packet.sides.at_end[lane];
    if (packet.before[lane] != kSideNotCertain) continue;
    const Ray ray = make_ray(&level.frame, packet.ray_id(level.frame, lane));
    BlockCoords cell;
    packet.before[lane] = static_cast<uchar>(
        kSide(level, ray, last_planes(&level.frame), level.frame.band.end_t, &cell));
  }
}

/// trace_rays_of_levels() in packets.
template <auto kTraceBand, auto kSide>
inline uint trace_levels(std::span<const HostLevel> levels, const RayTile &tile, bool is_smooth,
                         HitRecord *hits) {
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; y += 2) {
    for (uint x = tile.begin_x; x < tile.end_x; x += 4) {
      const uint columns = tile.end_x - x < 4 ? (1u << (tile.end_x - x)) - 1 : 0xFu;
      RayPacket packet = {x, y, y + 1 < tile.end_y ? columns | columns << 4 : columns, {}, {}};
      for (const HostLevel &level : levels) {
        uint found = kTraceBand(level, x, y, packet.lanes, hits, &packet.sides);
        if (&level != levels.data()) found |= hit_at_borders<kSide>(level, packet, hits);
        num_hits += static_cast<uint>(std::popcount(found));
        packet.lanes &= ~found;
        if (packet.lanes == 0) break;
        if (&level != &levels.back()) end_band<kSide>(level, packet);
      }
    }
  }
  if (is_smooth && num_hits != 0) smooth_levels(levels, tile, hits);
  return num_hits;
}
#endif

template <auto kTraceRay>
inline void cast(const FrameParams &frame, const HostField &field, const IndexRay *rays,
                 uint num_rays, bool is_smooth, HitRecord *hits) {
  const LastPlanes last = last_planes(&frame);
  const ActiveBox box = active_box(frame.surface, last);
  for (uint i = 0; i < num_rays; ++i) {
    if (!kTraceRay(frame, field, box, last, make_given_ray(rays[i].ray), hits + i)) continue;
    hits[i].t *= rays[i].t_scale;
    if (is_smooth) smooth_gradient(frame, field, last, hits + i);
  }
}

template <auto kTraceRay>
inline void ambient(const FrameParams &frame, const HostField &field, const RayTile &tile,
                    const AmbientRays &rays, const HitRecord *hits, uchar *open_counts) {
  const LastPlanes last = last_planes(&frame);
  const ActiveBox box = active_box(frame.surface, last);
  HitRecord met;
  for (uint y = tile.begin_y; y < tile.end_y; ++y) {
    for (uint x = tile.begin_x; x < tile.end_x; ++x) {
      const uint ray_id = x + frame.view.width * y;
      if (!is_hit_of(frame, hits[ray_id])) continue;
      const HitRecord placed = placed_hit(&frame, rays.level, hits[ray_id]);
      const uint pattern = ambient_pattern(&frame, ray_id);
      uint num_open = 0;
      for (uint k = 0; k < rays.num_rays; ++k) {
        const GivenRay given = ambient_ray(rays.seen, &rays.params, placed, ray_id,
                                           rays.directions[k * ISO_AMBIENT_PATTERNS + pattern]);
        num_open += !kTraceRay(frame, field, box, last, make_given_ray(given), &met);
      }
      open_counts[ray_id] = static_cast<uchar>(num_open);
    }
  }
}

inline void shade(const FrameParams &frame, const ShadeParams &params, uint samples, uint row,
                  const HitRecord *hits, const uchar *open_counts, uint num_ambient,
                  std::uint8_t *rgb) {
  const uint columns = frame.view.width / samples;
  for (uint column = 0; column < columns; ++column) {
    const uint rgba =
        shade_pixel(&frame, &params, samples, column, row, hits, open_counts, num_ambient);
    for (uint channel = 0; channel < 3; ++channel)
      rgb[3 * column + channel] = static_cast<std::uint8_t>(rgba >> (8 * channel));
  }
}

ISO_WHOLE_LOOP void decode_anywhere(const EncodedBlock &block, float *values) {
  decode(block, values);
}
ISO_WHOLE_LOOP void ranges_anywhere(const EncodedBlock &block, BlockRange *parts) {
  ranges(block, parts);
}
ISO_WHOLE_LOOP ulong inside_anywhere(const float *values, float isovalue) {
  return inside(values, isovalue);
}
ISO_OF_ITS_OWN ISO_WHOLE_LOOP uint trace_rays_of_levels_anywhere(std::span<const HostLevel> levels,
                                                                 const RayTile &tile,
                                                                 bool is_smooth, HitRecord *hits) {
  return trace_rays_of_levels<trace_ray_anywhere, side_anywhere>(levels, tile, is_smooth, hits);
}
ISO_WHOLE_LOOP void cast_anywhere(const FrameParams &frame, const HostField &field,
                                  const IndexRay *rays, uint num_rays, bool is_smooth,
                                  HitRecord *hits) {
  cast<trace_ray_anywhere>(frame, field, rays, num_rays, is_smooth, hits);
}
ISO_WHOLE_LOOP void ambient_anywhere(const FrameParams &frame, const HostField &field,
                                     const RayTile &tile, const AmbientRays &rays,
                                     const HitRecord *hits, uchar *open_counts) {
  ambient<trace_ray_anywhere>(frame, field, tile, rays, hits, open_counts);
}
ISO_WHOLE_LOOP void shade_anywhere(const FrameParams &frame, const ShadeParams &params,
                                   uint samples, uint row, const HitRecord *hits,
                                   const uchar *open_counts, uint num_ambient, std::uint8_t *rgb) {
  shade(frame, params, samples, row, hits, open_counts, num_ambient, rgb);
}

/// One level is a special case of several.
template <auto kTraceLevels>
uint trace_rays(const FrameParams &frame, const HostField &field, const RayTile &tile,
                bool is_smooth, HitRecord *hits) {
  const HostLevel level{frame, field};
  return kTraceLevels({&level, 1}, tile, is_smooth, hits);
}

#ifdef ISO_HAS_WIDE_LOOPS
ISO_WIDE_LOOP void decode_wide(const EncodedBlock &block, float *values) {
  decode(block, values);
}
ISO_WIDE_LOOP void ranges_wide(const EncodedBlock &block, BlockRange *parts) {
  ranges(block, parts);
}
/// By hand: compilers shift 64 numbers of 64 bits.
ISO_WIDE_LOOP ulong inside_wide(const float *values, float isovalue) {
  const __m256 from = _mm256_set1_ps(isovalue), zero = _mm256_setzero_ps();
  ulong bits = 0;
  for (uint v = 0; v < ISO_BLOCK_VOXELS; v += 8) {
    const __m256 w = _mm256_sub_ps(_mm256_loadu_ps(values + v), from);
    const int inside = _mm256_movemask_ps(_mm256_cmp_ps(w, zero, _CMP_GE_OQ));
    bits |= static_cast<ulong>(static_cast<uint>(inside)) << v;
  }
  return bits;
}
ISO_WIDE_LOOP uint trace_wide(const FrameParams &frame, const HostField &field, const RayTile &tile,
                              bool is_smooth, HitRecord *hits) {
  const uint num_hits = trace_packets(frame, field, tile, hits);
  if (is_smooth && num_hits > 0) smooth(frame, field, tile, hits);
  return num_hits;
}
ISO_WIDE_LOOP uint trace_levels_wide(std::span<const HostLevel> levels, const RayTile &tile,
                                     bool is_smooth, HitRecord *hits) {
  return trace_levels<trace_band_packet, side_wide>(levels, tile, is_smooth, hits);
}
ISO_OF_ITS_OWN ISO_WIDE_LOOP uint trace_rays_of_levels_wide(std::span<const HostLevel> levels,
                                                            const RayTile &tile, bool is_smooth,
                                                            HitRecord *hits) {
  return trace_rays_of_levels<trace_ray_wide, side_wide>(levels, tile, is_smooth, hits);
}
ISO_WIDE_LOOP void cast_wide(const FrameParams &frame, const HostField &field, const IndexRay *rays,
                             uint num_rays, bool is_smooth, HitRecord *hits) {
  cast<trace_ray_wide>(frame, field, rays, num_rays, is_smooth, hits);
}
ISO_WIDE_LOOP void ambient_wide(const FrameParams &frame, const HostField &field,
                                const RayTile &tile, const AmbientRays &rays, const HitRecord *hits,
                                uchar *open_counts) {
  ambient<trace_ray_wide>(frame, field, tile, rays, hits, open_counts);
}
ISO_WIDE_LOOP void shade_wide(const FrameParams &frame, const ShadeParams &params, uint samples,
                              uint row, const HitRecord *hits, const uchar *open_counts,
                              uint num_ambient, std::uint8_t *rgb) {
  shade(frame, params, samples, row, hits, open_counts, num_ambient, rgb);
}

uint trace_sse4(const FrameParams &frame, const HostField &field, const RayTile &tile,
                bool is_smooth, HitRecord *hits) {
  const uint num_hits = trace_packets_sse4(frame, field, tile, hits);
  if (is_smooth && num_hits > 0) smooth(frame, field, tile, hits);
  return num_hits;
}

ISO_WHOLE_LOOP uint trace_levels_sse4(std::span<const HostLevel> levels, const RayTile &tile,
                                      bool is_smooth, HitRecord *hits) {
  return trace_levels<trace_band_packet_sse4, side_anywhere>(levels, tile, is_smooth, hits);
}

/// With fused multiply-add, single rays are faster.
bool is_narrow() {
  return __builtin_cpu_supports("sse4.1") && __builtin_cpu_supports("popcnt") &&
         !__builtin_cpu_supports("fma");
}
bool is_wide() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") &&
         __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma") &&
         __builtin_cpu_supports("popcnt");
}
#endif

constexpr HostLoops kLoops[] = {
    {decode_anywhere, ranges_anywhere, inside_anywhere, trace_rays<trace_rays_of_levels_anywhere>,
     trace_rays<trace_rays_of_levels_anywhere>, trace_rays_of_levels_anywhere,
     trace_rays_of_levels_anywhere, cast_anywhere, ambient_anywhere, shade_anywhere},
#ifdef ISO_HAS_WIDE_LOOPS
    {decode_anywhere, ranges_anywhere, inside_anywhere, trace_sse4,
     trace_rays<trace_rays_of_levels_anywhere>, trace_levels_sse4, trace_rays_of_levels_anywhere,
     cast_anywhere, ambient_anywhere, shade_anywhere},
    {decode_wide, ranges_wide, inside_wide, trace_wide, trace_rays<trace_rays_of_levels_wide>,
     trace_levels_wide, trace_rays_of_levels_wide, cast_wide, ambient_wide, shade_wide},
#endif
};

}  // namespace

std::span<const HostLoops> all_host_loops() {
#ifdef ISO_HAS_WIDE_LOOPS
  static const std::size_t count = is_wide() ? 3 : is_narrow() ? 2 : 1;
  return std::span(kLoops).first(count);
#else
  return kLoops;
#endif
}

}  // namespace isowave::core
