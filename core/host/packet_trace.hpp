#pragma once
// Eight rays at a time through a HostField (kernels_cl/portable/packet_walk.h): the hits of the
// scalar walk, bit for bit. Only host_packets*.cpp include this file; each compiles it for a kind
// of processor (float8.hpp).

#include <bit>
#include <cstddef>

#include "core/frame/solvers.hpp"
#include "core/host/float8.hpp"
#include "core/host/host_loops.hpp"
#include "core/host/host_packets.hpp"
#include "kernels_cl/portable/cell_intersect.h"

namespace isowave::core::ISO_PACKET_NAMESPACE {

static_assert(kDefaultSolver.kind == ISO_SOLVER_BERNSTEIN, "there is no other here");

// ---- The source of blocks: see packet_regions.h.

using PacketField = HostField;

inline void macrocell_bits(const PacketField *field, Ints macrocells, Mask lanes, Ints *low,
                           Ints *high) {
  gather_halves(field->masks, macrocells, lanes, low, high);
}

/// Calls HostField::open() once for each block. Lanes have few different blocks.
inline Mask open_blocks(const PacketField *field, const FrameParams *frame, const Ints *at,
                        Mask lanes, Ints *low, Ints *high) {
  const auto columns = static_cast<int>(frame->grid.blocks_x),
             rows = static_cast<int>(frame->grid.blocks_y);
  const Ints blocks = at[0] + columns * (at[1] + rows * at[2]);
  for (unsigned left = bits_of(lanes); left != 0;) {
    const int block = blocks[std::countr_zero(left)];
    field->open(static_cast<uint>(block));
    left &= ~bits_of(blocks == block);
  }
  gather_halves(field->changing, blocks, lanes, low, high);
  return ints(0);
}

/// Blocks lie one behind the other, so a voxel's place is the sum of one term for each coordinate.
inline Mask load_corners(const PacketField *field, const FrameParams *frame, const Ints *at,
                         Mask lanes, Floats *w) {
  const std::size_t row = std::size_t{ISO_BLOCK_VOXELS} * frame->grid.blocks_x,
                    layer = row * frame->grid.blocks_y;
  const auto place = [](int voxel, std::size_t block, int step) {
    const auto v = static_cast<std::size_t>(voxel);
    return (v >> 2) * block + static_cast<std::size_t>(step) * (v & 3);
  };
  for (int corner = 0; corner < 8; ++corner) w[corner] = floats(0);
  ISO_EACH_LANE(lane, lanes) {
    const int x = at[0][lane], y = at[1][lane], z = at[2][lane];
    const std::size_t xs[2] = {place(x, ISO_BLOCK_VOXELS, 1), place(x + 1, ISO_BLOCK_VOXELS, 1)},
                      ys[2] = {place(y, row, 4), place(y + 1, row, 4)},
                      zs[2] = {place(z, layer, 16), place(z + 1, layer, 16)};
    for (int corner = 0; corner < 8; ++corner)
      w[corner][lane] = field->values[xs[corner & 1] + ys[corner >> 1 & 1] + zs[corner >> 2]];
  }
  for (int corner = 0; corner < 8; ++corner) w[corner] -= frame->surface.isovalue;
  return ints(0);
}

/// As packet_sides.h says.
inline void sides_in_cells(const PacketField *field, const FrameParams *frame, const Ints *at,
                           Mask lanes, Mask certain, Ints *sides) {
  const Ints blocks[3] = {at[0] >> 2, at[1] >> 2, at[2] >> 2};
  const auto block_of = [&](unsigned lane) {
    return BlockCoords{static_cast<uint>(blocks[0][lane]), static_cast<uint>(blocks[1][lane]),
                       static_cast<uint>(blocks[2][lane])};
  };
  Mask in_active = ints(0);
  ISO_EACH_LANE(lane, lanes) {
    const uint side = side_of_block(*frame, *field, block_of(lane));
    if (side == ISO_SIDE_UNKNOWN) {
      in_active[lane] = -1;
    } else {
      (*sides)[lane] = static_cast<int>(side);
    }
  }
  in_active &= certain;
  if (field->has_gaps || !any(in_active)) return;
  Ints low = ints(0), high = ints(0);
  open_blocks(field, frame, blocks, in_active, &low, &high);
  const Ints numbers = (at[0] & 3) + 4 * (at[1] & 3) + 16 * (at[2] & 3),
             changing = pick(numbers < 32, low, high) & bit_at(numbers & 31);
  ISO_EACH_LANE(lane, in_active & (changing == 0)) {
    const BlockCoords b = block_of(lane);
    const std::size_t block = level_block_at(frame, b.x, b.y, b.z);
    const float voxel =
        field->values[ISO_BLOCK_VOXELS * block + static_cast<std::size_t>(numbers[lane])];
    (*sides)[lane] = voxel - frame->surface.isovalue >= 0.0f ? ISO_SIDE_INSIDE : ISO_SIDE_OUTSIDE;
  }
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE

#include "kernels_cl/portable/packet_clip.h"
#include "kernels_cl/portable/packet_sides.h"
#include "kernels_cl/portable/packet_walk.h"

namespace isowave::core::ISO_PACKET_NAMESPACE {

/// The rays of a packet lie in 4 columns and 2 rows from (x, y) on.
inline Ints columns_from(uint x) {
  return static_cast<int>(x) + Ints{0, 1, 2, 3, 0, 1, 2, 3};
}
inline Ints rows_from(uint y) {
  return static_cast<int>(y) + Ints{0, 0, 0, 0, 1, 1, 1, 1};
}
inline Mask lanes_of(uint bits) {
  return (static_cast<int>(bits) & Ints{1, 2, 4, 8, 16, 32, 64, 128}) != 0;
}

inline void make_packet_rays(const FrameParams &frame, Ints column, Ints row, PacketRays *rays) {
  make_packet_axes(&frame, column, row, rays->axis);
  set_packet_interval(rays, frame.band);
}

/// Traces a packet's rays in the given lanes, in their intervals. ids: where their hits are
/// written. Returns the lanes that hit something. A function of its own, since it is long.
__attribute__((flatten, noinline)) inline Mask trace_packet(const PacketScene &scene, Ints ids,
                                                            Mask lanes, HitRecord *hits,
                                                            Packet *p) {
  const Mask enters = enter_box(&p->rays, &scene) & lanes;
  if (!any(enters)) return enters;
  open_packet(p, &scene);
  begin_at_box(p, &scene, enters);
  walk_packet(p, &scene);
  if (!any(p->found.lanes)) return p->found.lanes;
  write_hits(p, &scene, ids, kDefaultSolver.max_steps, hits);
  return p->found.lanes;
}

inline Ints ray_ids(const FrameParams &frame, Ints column, Ints row) {
  return column + static_cast<int>(frame.view.width) * row;
}

/// As trace_packets().
__attribute__((flatten)) inline uint trace_tile(const FrameParams &frame, const HostField &field,
                                                const RayTile &tile, HitRecord *hits) {
  PacketScene scene;
  if (!make_packet_scene(&frame, &field, &scene)) return 0;
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; y += 2) {
    for (uint x = tile.begin_x; x < tile.end_x; x += 4) {
      const Ints column = columns_from(x), row = rows_from(y);
      const Mask within =
          (column < static_cast<int>(tile.end_x)) & (row < static_cast<int>(tile.end_y));
      Packet p;
      make_packet_rays(frame, column, row, &p.rays);
      const Mask found = trace_packet(scene, ray_ids(frame, column, row), within, hits, &p);
      num_hits += static_cast<uint>(std::popcount(bits_of(found)));
    }
  }
  return num_hits;
}

inline void keep_sides(Ints of_lanes, Mask lanes, uchar *sides) {
  const Ints known = pick(lanes, of_lanes, ints(ISO_SIDE_UNKNOWN));
  for (int lane = 0; lane < 8; ++lane) sides[lane] = static_cast<uchar>(known[lane]);
}

/// As trace_band_packet().
__attribute__((flatten)) inline uint trace_band(const HostLevel &level, uint x, uint y, uint lanes,
                                                HitRecord *hits, bool by_lane, BandSides *sides) {
  const FrameParams &frame = level.frame;
  const Ints column = columns_from(x), row = rows_from(y);
  const Mask of = lanes_of(lanes);
  Packet p;
  make_packet_rays(frame, column, row, &p.rays);
  *sides = {};
  Mask drawn = of;
  if (level.clip != nullptr) {
    clip_packet(&frame, level.clip, column, row, &p.rays);
    drawn &= have_intervals(&p.rays);
    sides->cut = bits_of(of & (p.rays.cut_by != ISO_NOT_CUT));
    if (level.clip->with_caps != 0) sides->capped = sides->cut;
    sides->ended = bits_of(of & (p.rays.end_t < frame.band.end_t));
  }
  PacketScene scene;
  const bool is_active = make_packet_scene(&frame, &level.field, &scene) != 0;
  const Mask begins_late = drawn & (p.rays.begin_t > 0.0f);
  if (any(begins_late))
    keep_sides(find_sides(&scene, &p.rays, p.rays.begin_t, begins_late), begins_late,
               sides->at_begin);
  const Ints ids = by_lane ? Ints{0, 1, 2, 3, 4, 5, 6, 7} : ray_ids(frame, column, row);
  const Mask found = is_active ? trace_packet(scene, ids, drawn, hits, &p) : ints(0);
  const Mask left = drawn & ~found & (p.rays.end_t == frame.band.end_t);
  if (frame.band.end_t < ISO_NEVER && any(left))
    keep_sides(find_sides(&scene, &p.rays, p.rays.end_t, left), left, sides->at_end);
  return bits_of(found);
}

/// Puts lanes into cells of active blocks (at [3]: x, y, z) that need not be looked into.
inline void begin_at_cells(Packet *p, const PacketScene *scene, const Ints *at, Mask lanes) {
  PacketLevel *cells = &p->level[ISO_CELLS], *blocks = &p->level[ISO_BLOCKS],
              *macrocells = &p->level[ISO_MACROCELLS];
  cells->place = blocks->place = macrocells->place = ints(0);
  ISO_EACH_OF_3(axis) {
    ISO_EACH_OF_3(level) {
      p->level[level].far[axis] =
          far_planes(p, axis, ISO_REGION_SIZE(level), at[axis] >> (2 * level));
    }
    cells->place += (at[axis] & 3) << (2 * axis);
    blocks->place += (at[axis] >> 2 & 3) << (2 * axis);
    macrocells->place +=
        (at[axis] >> 4) * (axis == 0 ? 1 : scene->columns * (axis == 1 ? 1 : scene->rows));
  }
  macrocell_bits(scene->field, macrocells->place, lanes, &blocks->low, &blocks->high);
  Ints block[3];
  blocks_at(p, block);
  open_blocks(scene->field, scene->frame, block, lanes, &cells->low, &cells->high);
  const Ints bit = bit_at(cells->place & 31);
  cells->low &= pick(cells->place < 32, ~bit, ints(-1));
  cells->high &= pick(cells->place < 32, ints(-1), ~bit);
  p->rays.entered.axis = ints(0); /* lanes leave the cells before this is asked for */
  p->rays.entered.plane = floats(0.0f);
  p->at[ISO_CELLS] = lanes;
}

/// As trace_packet_behind().
__attribute__((flatten)) inline void trace_behind(const HostLevel &surface, uint x, uint y,
                                                  uint lanes, uint capped, const HitRecord *hits,
                                                  HitRecord *next) {
  const FrameParams &frame = surface.frame;
  PacketScene scene;
  if (!make_packet_scene(&frame, &surface.field, &scene)) return;
  const Ints column = columns_from(x), row = rows_from(y), ids{0, 1, 2, 3, 4, 5, 6, 7};
  Packet p;
  make_packet_rays(frame, column, row, &p.rays);
  if (surface.clip != nullptr) clip_packet(&frame, surface.clip, column, row, &p.rays);
  if (capped != 0) trace_packet(scene, ids, lanes_of(capped), next, &p);
  if (lanes == 0) return;
  const Mask of = lanes_of(lanes);
  Ints at[3] = {ints(0), ints(0), ints(0)};
  ISO_EACH_LANE(lane, of) {
    const BlockCoords b = block_coords(&frame, hits[lane].block_id);
    at[0][lane] = static_cast<int>(4 * b.x + (hits[lane].cell & 3));
    at[1][lane] = static_cast<int>(4 * b.y + (hits[lane].cell >> 2 & 3));
    at[2][lane] = static_cast<int>(4 * b.z + (hits[lane].cell >> 4 & 3));
  }
  open_packet(&p, &scene);
  begin_at_cells(&p, &scene, at, of);
  walk_packet(&p, &scene);
  if (any(p.found.lanes)) write_hits(&p, &scene, ids, kDefaultSolver.max_steps, next);
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE
