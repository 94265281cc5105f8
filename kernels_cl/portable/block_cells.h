/// block_cells.h -- a ray among the cells of one block, and pixels in an order in which neighbours
/// share blocks. Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_BLOCK_CELLS_H
#define ISOWAVE_BLOCK_CELLS_H

#include "block_grid.h"
#include "grid_dda.h"

ISO_NAMESPACE_BEGIN

/// A ray's way through the cells of one block:
///
///     CellWalk at = enter_cells(ray, b, enter, last);
///     do {
///       // the ray is in cell at.cell from at.enter to at.exit
///     } while (next_cell(&at, ray, last));
typedef struct CellWalk {
  GridWalk block, cell;
  RayEvent enter, exit;  ///< of the cell
} CellWalk;

/// At cell (x,y,z), which the ray enters by `enter`.
ISO_INLINE CellWalk start_at_cell(const Ray *ray, int x, int y, int z, RayEvent enter,
                                  LastPlanes last) {
  CellWalk at;
  at.block = walk_from(ray, x >> 2, y >> 2, z >> 2, 4, last);
  at.cell = walk_from(ray, x, y, z, 1, last);
  at.enter = enter;
  at.exit = walk_exit(&at.cell, ray);
  return at;
}

/// The cell along one axis of block b, of those before the domain's last plane, in which the ray is
/// just after `enter`.
ISO_INLINE int locate_in_block(RayAxis a, int axis, RayEvent enter, int b, int last_plane) {
  const int first = 4 * b, end = first + 3 < last_plane ? first + 3 : last_plane - 1;
  return locate(a, axis, enter, 1, first, end);
}

/// At the cell of block b in which the ray is just after `enter`, by which it entered the block.
ISO_INLINE CellWalk enter_cells(const Ray *ray, BlockCoords b, RayEvent enter, LastPlanes last) {
  return start_at_cell(ray, locate_in_block(ray->x, 0, enter, (int)b.x, last.x),
                       locate_in_block(ray->y, 1, enter, (int)b.y, last.y),
                       locate_in_block(ray->z, 2, enter, (int)b.z, last.z), enter, last);
}

/// Goes on to the next cell. Returns 0 if the ray leaves the block instead.
ISO_INLINE int next_cell(CellWalk *at, const Ray *ray, LastPlanes last) {
  if (leaves(&at->cell, &at->block, at->exit)) return 0;
  walk_step(&at->cell, ray, at->exit, 1, last);
  at->enter = at->exit;
  at->exit = walk_exit(&at->cell, ray);
  return 1;
}

/// The number of a cell in its block, x + 4y + 16z.
ISO_INLINE uint cell_in_block(const GridWalk *cell) {
  return (uint)((cell->x & 3) + 4 * (cell->y & 3) + 16 * (cell->z & 3));
}

/// The corners of a block's cells that are inside: bit x + 4y + 16z of v[corner x + 2y + 4z].
/// inside [8]: the voxels of its dual grid's blocks that are inside. If a block is not known, the
/// cells that need it have any bit.
ISO_INLINE void corners_inside(const ulong *inside, ulong *v) {
  /* Voxels at +x of every cell: own voxels moved one down, the last layer from the neighbour. The
   * same for +y, +z. */
  const ulong not_x3 = 0x7777777777777777ul, not_y3 = 0x0FFF0FFF0FFF0FFFul,
              not_z3 = 0x0000FFFFFFFFFFFFul;
  int i;
  for (i = 0; i < 8; ++i) v[i] = inside[i];
  for (i = 0; i < 8; i += 2) v[i + 1] = (v[i] >> 1 & not_x3) | (v[i + 1] << 3 & ~not_x3);
  for (i = 0; i < 8; i += 4) {
    v[i + 2] = (v[i] >> 4 & not_y3) | (v[i + 2] << 12 & ~not_y3);
    v[i + 3] = (v[i + 1] >> 4 & not_y3) | (v[i + 3] << 12 & ~not_y3);
  }
  for (i = 0; i < 4; ++i) v[i + 4] = (v[i] >> 16 & not_z3) | (v[i + 4] << 48 & ~not_z3);
}

/// The cells of a block (bit x + 4y + 16z) whose corners are not all on one side. inside [8] as in
/// corners_inside().
ISO_INLINE ulong changing_cells(const ulong *inside) {
  ulong v[8], any = 0, all = ~0ul;
  int i;
  corners_inside(inside, v);
  for (i = 0; i < 8; ++i) {
    any |= v[i];
    all &= v[i];
  }
  return any & ~all;
}

/// Part of the image, in whole tiles of 8 x 4 pixels but for its end.
typedef struct PixelBox {
  uint begin_x, begin_y, end_x, end_y;
} PixelBox;

/// Number of work-items laid over a box, tile by tile, so that neighbours share blocks.
ISO_INLINE uint num_tiled_pixels(PixelBox box) {
  return 32 * ((box.end_x - box.begin_x + 7) / 8) * ((box.end_y - box.begin_y + 3) / 4);
}

/// The pixel of such a work-item i, or ISO_INVALID_ID beyond the box.
ISO_INLINE uint tiled_pixel(const FrameParams *frame, PixelBox box, uint i) {
  const uint tiles_x = (box.end_x - box.begin_x + 7) / 8, tile = i / 32;
  const uint x = box.begin_x + 8 * (tile % tiles_x) + (i & 7);
  const uint y = box.begin_y + 4 * (tile / tiles_x) + (i >> 3 & 3);
  return x < box.end_x && y < box.end_y ? x + frame->view.width * y : ISO_INVALID_ID;
}

ISO_NAMESPACE_END

#endif
