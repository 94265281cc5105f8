/// dual_grid_inside.h -- which voxels of a cached dual grid are inside, and so which triangles its
/// cells have. OpenCL C 1.2.
#ifndef ISOWAVE_DUAL_GRID_INSIDE_H
#define ISOWAVE_DUAL_GRID_INSIDE_H

#include "portable/block_table.h"
#include "portable/marching_cubes.h"

/// The voxels that are inside, for each block of the dual grid of block b, corner x + 2y + 4z; 0
/// for blocks that do not exist.
ISO_INLINE void dual_grid_inside(const FrameParams *frame, global const uint *table,
                                 global const ulong *inside, BlockCoords b, ulong *bits) {
  for (uint corner = 0; corner < 8; ++corner) {
    uint slot = ISO_BLOCK_ABSENT;
    if (dual_grid_block(frame, b, corner) != ISO_INVALID_ID)
      slot = cached_slot(frame, table, b.x + (corner & 1), b.y + (corner >> 1 & 1),
                         b.z + (corner >> 2));
    bits[corner] = slot == ISO_BLOCK_ABSENT ? 0 : inside[slot];
  }
}

/// Triangles of cells of a block.
///
/// cells           cells_with_data()
/// bits            dual_grid_inside(); v: corners_inside() of these
/// cell_triangles  [256 * ISO_CASE_BYTES] core/mesh/cell_triangles.hpp
ISO_INLINE uint count_triangles(ulong cells, const ulong *bits, const ulong *v,
                                global const uchar *cell_triangles) {
  const ulong changing = changing_cells(bits) & cells;
  uint triangles = 0;
  for (uint cell = 0; cell < 64; ++cell) {
    if ((changing >> cell & 1) != 0)
      triangles += cell_triangles[ISO_CASE_BYTES * cell_signs(v, cell)];
  }
  return triangles;
}

/// cell_signs() of cell (x,y,z) of a block, by a work-item for itself; 0 of one that is not among
/// `cells`, cells_with_data(). bits: dual_grid_inside().
ISO_INLINE uint signs_of_cell(ulong cells, local const ulong *bits, uint x, uint y, uint z) {
  uint signs = 0;
  if ((cells >> (x + 4 * y + 16 * z) & 1) == 0) return 0;
  for (uint corner = 0; corner < 8; ++corner) {
    const uint cx = x + (corner & 1), cy = y + (corner >> 1 & 1), cz = z + (corner >> 2);
    const ulong of_block = bits[(cx >> 2) + 2 * (cy >> 2) + 4 * (cz >> 2)];
    signs |= (uint)(of_block >> ((cx & 3) + 4 * (cy & 3) + 16 * (cz & 3)) & 1) << corner;
  }
  return signs;
}

#endif
