/// smooth_gradient.h -- the gradient that a hit is lit by: central differences at the eight voxels
/// of its dual cell, trilinear between them. Portable: OpenCL C 1.2 and C++.
///
/// The gradient of the trilinear field itself jumps from cell to cell, which shows as facets and
/// grooves. This one is the same from both sides of a face of cells: there it depends on the face's
/// four voxels alone. It needs 32 of the 4^3 voxels around the cell: those beyond the cell along
/// one axis. Along each axis they lie in at most two blocks.
///
/// At the domain's border, and beside a voxel without data, a difference is one-sided. If all
/// differences vanish, as in a sheet one voxel thick, there is no smooth gradient, and the cell's
/// own stays.
#ifndef ISOWAVE_SMOOTH_GRADIENT_H
#define ISOWAVE_SMOOTH_GRADIENT_H

#include "cell_intersect.h"

ISO_NAMESPACE_BEGIN

/// The voxels along one axis [index space]: the cell's own are `cell` and the next.
typedef struct StencilAxis {
  int below, cell, above;  ///< beyond the domain's border: the voxel at the border
  float low, high;  ///< 1 / distance of the voxels that the differences at both ends are between
} StencilAxis;

/// All voxels that the gradient in a cell is made of.
typedef struct Stencil {
  StencilAxis x, y, z;
} Stencil;

typedef struct Gradient {
  float x, y, z;  ///< [value per voxel], index space
} Gradient;

/// cell: 0 .. last_plane - 1.
ISO_INLINE StencilAxis stencil_axis(int cell, int last_plane) {
  StencilAxis axis;
  const int is_first = cell == 0, is_last = cell + 1 == last_plane;
  axis.below = is_first ? cell : cell - 1;
  axis.cell = cell;
  axis.above = is_last ? cell + 1 : cell + 2;
  axis.low = is_first ? 1.0f : 0.5f;
  axis.high = is_last ? 1.0f : 0.5f;
  return axis;
}

/// The stencil of a hit in a cell of block b.
ISO_INLINE Stencil stencil_of(BlockCoords b, uint cell, LastPlanes last) {
  Stencil s;
  s.x = stencil_axis((int)(4 * b.x + (cell & 3)), last.x);
  s.y = stencil_axis((int)(4 * b.y + (cell >> 2 & 3)), last.y);
  s.z = stencil_axis((int)(4 * b.z + (cell >> 4 & 3)), last.z);
  return s;
}

/// The lowest block of the stencil along each axis. Its voxels are in this and the next one.
ISO_INLINE BlockCoords stencil_base(const Stencil *s) {
  BlockCoords base;
  base.x = (uint)s->x.below >> 2;
  base.y = (uint)s->y.below >> 2;
  base.z = (uint)s->z.below >> 2;
  return base;
}

/// The blocks, of base and base + 1 along an axis, that two voxels are in: bits 0 and 1.
ISO_INLINE uint blocks_of_voxels(int a, int b, uint base) {
  return 1u << (((uint)a >> 2) - base) | 1u << (((uint)b >> 2) - base);
}

/// The corners x + 2y + 4z (bits 0..7) of 2^3 blocks whose places along the axes are in these
/// pairs.
ISO_INLINE uint corners_of(uint x, uint y, uint z) {
  return ((x & 1u) * 0x55u | (x >> 1) * 0xAAu) & ((y & 1u) * 0x33u | (y >> 1) * 0xCCu) &
         ((z & 1u) * 0x0Fu | (z >> 1) * 0xF0u);
}

/// The blocks of the stencil, bits 0..7: corner x + 2y + 4z is stencil_base() + (x,y,z).
ISO_INLINE uint stencil_blocks(const Stencil *s) {
  const BlockCoords base = stencil_base(s);
  const uint x = blocks_of_voxels(s->x.cell, s->x.cell + 1, base.x),
             y = blocks_of_voxels(s->y.cell, s->y.cell + 1, base.y),
             z = blocks_of_voxels(s->z.cell, s->z.cell + 1, base.z);
  return corners_of(x | blocks_of_voxels(s->x.below, s->x.above, base.x), y, z) |
         corners_of(x, y | blocks_of_voxels(s->y.below, s->y.above, base.y), z) |
         corners_of(x, y, z | blocks_of_voxels(s->z.below, s->z.above, base.z));
}

/// The derivative along one axis at a position in the cell.
///
/// corners [8]  the cell's voxels, corner x + 2y + 4z; all have data
/// beyond [8]   the voxel beyond each of these along the axis, away from the cell
/// step         1, 2 or 4: from corner to corner along the axis
ISO_INLINE float smooth_derivative(const float *corners, const float *beyond, uint step,
                                   StencilAxis axis, CellPoint at) {
  float d[8];
  uint i;
  ISO_UNROLL
  for (i = 0; i < 8u; ++i) {
    d[i] = (i & step) == 0u ? (corners[i + step] - beyond[i]) * axis.low
                            : (beyond[i] - corners[i - step]) * axis.high;
    if (ISO_NO_DATA && is_no_data(beyond[i])) d[i] = corners[i | step] - corners[i & ~step];
  }
  return without_zero_sign(lerp(at.z, lerp(at.y, lerp(at.x, d[0], d[1]), lerp(at.x, d[2], d[3])),
                                lerp(at.y, lerp(at.x, d[4], d[5]), lerp(at.x, d[6], d[7]))));
}

ISO_INLINE int is_no_gradient(Gradient g) {
  return g.x == 0.0f && g.y == 0.0f && g.z == 0.0f;
}

ISO_NAMESPACE_END

#endif
