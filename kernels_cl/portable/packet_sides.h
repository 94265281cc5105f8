/// packet_sides.h -- on which side of the surface eight rays are at a border between levels of
/// detail.
///
/// Portable: OpenCL C 1.2 and C++. The file that includes it defines before, besides what
/// packet_regions.h needs:
///
///     // Gives lanes in cells (at [3]: x, y, z) their side, ISO_SIDE_*, if the cell's block is
///     // on one side as a whole; lanes `certain` also if the cell is. Others stay as they are.
///     void sides_in_cells(const PacketField *field, const FrameParams *frame, const Ints *at,
///                         Mask lanes, Mask certain, Ints *sides);
#ifndef ISOWAVE_PACKET_SIDES_H
#define ISOWAVE_PACKET_SIDES_H

#include "packet_regions.h"
#include "ray_state.h"

ISO_PACKET_NAMESPACE_BEGIN

/// Lanes that leave before t, by float32 without doubt, the domains of this level and of the
/// num_coarser next ones. A level's domain ends at most one voxel of the level before it behind the
/// domain of that level (coarser_level() of core/volume/pyramid.hpp).
ISO_INLINE Mask have_left(const PacketScene *scene, const PacketRays *rays, Floats t,
                          uint num_coarser) {
  const Floats before = t - 2.0f * ISO_FLOAT_DOUBT * t;
  Mask left = ints(0);
  ISO_EACH_OF_3(axis) {
    const PacketAxis *a = &rays->axis[axis];
    const float end = (float)(scene->last[axis] + (1 << num_coarser));
    left |= packet_float_t(a, in_whole(a, pick(a->up, floats(end), floats(0.0f)))) < before;
  }
  return left;
}

/// The cells in which rays are at t, as far as float32 knows.
typedef struct CellsAtBorder {
  Mask within;                     ///< lanes that are in the domain then
  Mask block_certain, is_certain;  ///< lanes for which that and the block are certain, and the cell
  Ints at[3];
} CellsAtBorder;

ISO_INLINE CellsAtBorder cells_at_border(const PacketScene *scene, const PacketRays *rays,
                                         Floats t) {
  CellsAtBorder cells;
  cells.within = cells.block_certain = cells.is_certain = ints(-1);
  ISO_EACH_OF_3(axis) {
    const PacketAxis *a = &rays->axis[axis];
    const Floats position = fma(t, a->d, a->o), at = in_brick(a, position),
                 error = ISO_FLOAT_DOUBT * (fabs(position) + fabs(a->o)),
                 last = floats((float)scene->last[axis]);
    cells.within &= (at > 0.0f) & (at < last);
    cells.block_certain &=
        (fabs(at - 4.0f * to_nearest(0.25f * at)) > error) & (fabs(at - last) > error);
    cells.is_certain &= fabs(at - to_nearest(at)) > error;
    const Floats not_below = larger(at, floats(0.0f)), within = smaller(not_below, last);
    cells.at[axis] = to_ints(within);
  }
  cells.is_certain &= cells.block_certain;
  return cells;
}

/// The sides of the surface on which rays are at t, of the given lanes, by the blocks and cells
/// that are on one side as a whole; unknown if they are not in the domain then.
/// ISO_SIDE_NOT_CERTAIN: a cell's values decide, or float32 is not enough.
ISO_INLINE Ints find_sides(const PacketScene *scene, const PacketRays *rays, Floats t, Mask lanes) {
  const CellsAtBorder cells = cells_at_border(scene, rays, t);
  const Mask in_blocks = lanes & cells.within & cells.block_certain;
  Ints sides = pick(cells.block_certain & ~cells.within, ints((int)ISO_SIDE_UNKNOWN),
                    ints((int)ISO_SIDE_NOT_CERTAIN));
  if (any(in_blocks)) {
    sides_in_cells(scene->field, scene->frame, cells.at, in_blocks, in_blocks & cells.is_certain,
                   &sides);
  }
  return sides;
}

ISO_PACKET_NAMESPACE_END

#endif
