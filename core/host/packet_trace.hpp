#pragma once
// Eight rays at a time through a HostField (kernels_cl/portable/packet_walk.h): the hits of the
// scalar walk, bit for bit. Only host_packets*.cpp include this file; each compiles it for a kind
// of processor (float8.hpp).

#include <bit>
#include <cstddef>

#include "core/frame/solvers.hpp"
#include "core/host/float8.hpp"
#include "core/host/host_loops.hpp"
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

}  // namespace isowave::core::ISO_PACKET_NAMESPACE

#include "kernels_cl/portable/packet_walk.h"

namespace isowave::core::ISO_PACKET_NAMESPACE {

/// Traces rays (column, row) of the frame in the given lanes. Returns how many hit something.
inline uint trace_packet(const PacketScene &scene, Ints column, Ints row, Mask lanes,
                         HitRecord *hits) {
  Packet p;
  make_packet_axes(scene.frame, column, row, p.rays.axis);
  const Mask enters = enter_box(&p.rays, &scene) & lanes;
  if (!any(enters)) return 0;
  open_packet(&p, &scene);
  begin_at_box(&p, &scene, enters);
  walk_packet(&p, &scene);
  if (!any(p.found.lanes)) return 0;
  write_hits(&p, &scene, column + static_cast<int>(scene.frame->view.width) * row,
             kDefaultSolver.max_steps, hits);
  return static_cast<uint>(std::popcount(bits_of(p.found.lanes)));
}

/// As trace_packets().
__attribute__((flatten)) inline uint trace_tile(const FrameParams &frame, const HostField &field,
                                                const RayTile &tile, HitRecord *hits) {
  PacketScene scene;
  if (!make_packet_scene(&frame, &field, &scene)) return 0;
  const Ints column_of_lane = {0, 1, 2, 3, 0, 1, 2, 3}, row_of_lane = {0, 0, 0, 0, 1, 1, 1, 1};
  uint num_hits = 0;
  for (uint y = tile.begin_y; y < tile.end_y; y += 2) {
    for (uint x = tile.begin_x; x < tile.end_x; x += 4) {
      const Ints column = static_cast<int>(x) + column_of_lane,
                 row = static_cast<int>(y) + row_of_lane;
      const Mask within =
          (column < static_cast<int>(tile.end_x)) & (row < static_cast<int>(tile.end_y));
      num_hits += trace_packet(scene, column, row, within, hits);
    }
  }
  return num_hits;
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE
