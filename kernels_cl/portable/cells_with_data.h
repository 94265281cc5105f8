/// cells_with_data.h -- the cells and edges of a block that may have a surface, beside voxels
/// without data. Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_CELLS_WITH_DATA_H
#define ISOWAVE_CELLS_WITH_DATA_H

#include "block_grid.h"
#include "marching_cubes.h"
#include "no_data.h"

ISO_NAMESPACE_BEGIN

/// The table of no_data.h within a buffer.
typedef struct NoDataTable {
  ISO_GLOBAL const uint *words;
  uint begin;  ///< ISO_INVALID_ID: all voxels have data
} NoDataTable;

/// The cells that block b owns (bit x + 4y + 16z), without those that have a corner without data.
ISO_INLINE ulong cells_with_data(const FrameParams *frame, const BlockGrid *grid,
                                 NoDataTable no_data, BlockCoords b) {
  ulong cells = domain_of_block(grid, b, 1, 1, 1);
  if (ISO_NO_DATA && no_data.begin != ISO_INVALID_ID) {
    ulong missing[8], of_corners[8];
    for (uint corner = 0; corner < 8; ++corner) {
      const uint id = dual_grid_block(frame, b, corner);
      missing[corner] = id == ISO_INVALID_ID ? 0 : no_data_mask(no_data.words + no_data.begin, id);
    }
    corners_inside(missing, of_corners);
    for (uint corner = 0; corner < 8; ++corner) cells &= ~of_corners[corner];
  }
  return cells;
}

/// Cells of a block moved to +x, +y or +z by one. before: the cells of the block before it there.
ISO_INLINE ulong moved_x(ulong cells, ulong before) {
  return (cells << 1 & 0xEEEEEEEEEEEEEEEEul) | (before >> 3 & 0x1111111111111111ul);
}
ISO_INLINE ulong moved_y(ulong cells, ulong before) {
  return (cells << 4 & 0xFFF0FFF0FFF0FFF0ul) | (before >> 12 & 0x000F000F000F000Ful);
}
ISO_INLINE ulong moved_z(ulong cells, ulong before) {
  return cells << 16 | before >> 48;
}

/// The given edges of block b that belong to a cell of cells_with_data(), of this block or of one
/// before it.
ISO_INLINE BlockEdges edges_with_data(const FrameParams *frame, const BlockGrid *grid,
                                      NoDataTable no_data, BlockCoords b, BlockEdges edges) {
  BlockEdges kept = edges;
  if (ISO_NO_DATA && no_data.begin != ISO_INVALID_ID && (edges.x | edges.y | edges.z) != 0) {
    ulong c[8]; /* of the block x, y, z before: x + 2y + 4z */
    for (uint i = 0; i < 8; ++i) {
      const uint x = i & 1, y = i >> 1 & 1, z = i >> 2;
      const BlockCoords at = {b.x - x, b.y - y, b.z - z};
      c[i] = b.x < x || b.y < y || b.z < z ? 0 : cells_with_data(frame, grid, no_data, at);
    }
    const ulong x = moved_x(c[0], c[1]), y = moved_y(c[0], c[2]), z = moved_z(c[0], c[4]);
    kept.x &= c[0] | y | z | moved_z(y, moved_y(c[4], c[6]));
    kept.y &= c[0] | x | z | moved_z(x, moved_x(c[4], c[5]));
    kept.z &= c[0] | x | y | moved_y(x, moved_x(c[2], c[3]));
  }
  return kept;
}

ISO_NAMESPACE_END

#endif
