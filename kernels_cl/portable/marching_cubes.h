/// marching_cubes.h -- the isosurface of one block's dual cells as triangles. Portable: OpenCL
/// C 1.2 and C++.
///
/// A vertex lies on an edge between two neighbouring voxels of which one is inside. The edge
/// belongs to the block of its lower voxel, and so does the vertex: blocks share vertices, and no
/// two vertices are on one edge. A block numbers its vertices by the axis of their edges, then by
/// voxel: the place of one among them is a count of bits.
///
/// Edges of a cell: 4 a + k goes along axis a from the corner whose places along the two other
/// axes, the lower first, are the bits of k. A table has the triangles of a cell by the signs of
/// its corners (core/mesh/cell_triangles.hpp).
#ifndef ISOWAVE_MARCHING_CUBES_H
#define ISOWAVE_MARCHING_CUBES_H

#include "block_cells.h"
#include "no_data.h"
#include "smooth_gradient.h"

ISO_NAMESPACE_BEGIN

#define ISO_CASE_BYTES 16u     ///< of the table for each of 256 signs: a count, 3 edges a triangle
#define ISO_CELL_TRIANGLES 5u  ///< at most
#define ISO_VERTEX_BLOCK_SHIFT 8  ///< MeshVertex::edge

/// The edges of a block that have a vertex: bit x + 4y + 16z of the lower voxel, for each axis.
typedef struct BlockEdges {
  ulong x, y, z;
} BlockEdges;
ISO_CHECK_SIZE(BlockEdges, 24);

/// A vertex: where on which edge.
typedef struct MeshVertex {
  uint edge;  ///< lower voxel x + 4y + 16z in bits 0..5, axis in bits 6..7, block of a batch above
  float t;    ///< place between the lower voxel (0) and the upper (1)
} MeshVertex;
ISO_CHECK_SIZE(MeshVertex, 8);

/// A triangle's vertices, counter-clockwise seen from where values are lower, in index space.
typedef struct MeshTriangle {
  uint a, b, c;
} MeshTriangle;
ISO_CHECK_SIZE(MeshTriangle, 12);

ISO_INLINE uint count_bits(ulong bits) {
  return popcount((uint)bits) + popcount((uint)(bits >> 32));
}

/// The voxels of a block (bit x + 4y + 16z) whose places along the axes are below nx, ny, nz, each
/// as far as it is not above 4.
ISO_INLINE ulong first_voxels(int nx, int ny, int nz) {
  ulong bits = 0x1111111111111111ul * (nx <= 0 ? 0u : nx >= 4 ? 15u : (1u << nx) - 1u);
  bits &= 0x0001000100010001ul * (ny <= 0 ? 0u : ny >= 4 ? 0xFFFFu : (1u << 4 * ny) - 1u);
  return nz <= 0 ? 0 : nz >= 4 ? bits : bits & (((ulong)1 << 16 * nz) - 1u);
}

/// The voxels of block b (bit x + 4y + 16z) that lie in the domain and, along axes with less_x,
/// less_y, less_z of 1, have a next one there. With 1 for all three: the cells that it owns.
ISO_INLINE ulong domain_of_block(const BlockGrid *grid, BlockCoords b, int less_x, int less_y,
                                 int less_z) {
  return first_voxels((int)(grid->dims_x - 4u * b.x) - less_x,
                      (int)(grid->dims_y - 4u * b.y) - less_y,
                      (int)(grid->dims_z - 4u * b.z) - less_z);
}

/// The edges of block b that have a vertex. v [8]: corners_inside().
ISO_INLINE BlockEdges crossed_edges(const BlockGrid *grid, BlockCoords b, const ulong *v) {
  BlockEdges edges;
  edges.x = (v[0] ^ v[1]) & domain_of_block(grid, b, 1, 0, 0);
  edges.y = (v[0] ^ v[2]) & domain_of_block(grid, b, 0, 1, 0);
  edges.z = (v[0] ^ v[4]) & domain_of_block(grid, b, 0, 0, 1);
  return edges;
}

ISO_INLINE uint vertex_count(BlockEdges edges) {
  return count_bits(edges.x) + count_bits(edges.y) + count_bits(edges.z);
}

/// The signs of a cell's corners: bit x + 2y + 4z is set of those inside. v [8]: corners_inside().
ISO_INLINE uint cell_signs(const ulong *v, uint cell) {
  uint signs = 0, corner;
  for (corner = 0; corner < 8u; ++corner) signs |= (uint)(v[corner] >> cell & 1u) << corner;
  return signs;
}

/// The lower voxel of a cell's edge, as a corner x + 2y + 4z of the cell; and the edge's axis.
ISO_INLINE uint edge_axis(uint edge) {
  return edge >> 2;
}
ISO_INLINE uint edge_corner(uint edge) {
  const uint k = edge & 3u;
  return edge < 4u ? 2u * k : edge < 8u ? (k & 1u) + 4u * (k >> 1) : k;
}

/// The place of a vertex among those of its block. x, y, z: those of BlockEdges.
ISO_INLINE uint vertex_rank(ulong x, ulong y, ulong z, uint axis, uint voxel) {
  const ulong below = ((ulong)1 << voxel) - 1u;
  if (axis == 0u) return count_bits(x & below);
  if (axis == 1u) return count_bits(x) + count_bits(y & below);
  return count_bits(x) + count_bits(y) + count_bits(z & below);
}

/// The place, 0 to 1, where the field crosses the isovalue between two voxels, one inside. Halves,
/// so that no difference overflows; scaling by a power of two changes no quotient.
ISO_INLINE float edge_crossing(float lower, float upper, float isovalue) {
  const float a = 0.5f * lower - 0.5f * isovalue, b = 0.5f * upper - 0.5f * isovalue;
  const float t = a / (a - b);
  return t >= 0.0f ? (t <= 1.0f ? t : 1.0f) : 0.0f; /* 0 / 0 of flushed denormals: 0 */
}

/// Along one axis, the difference at a voxel that smooth_gradient.h is made of. place: of the
/// voxel; last_plane: of the domain.
ISO_INLINE float voxel_derivative(float below, float above, int place, int last_plane) {
  return (above - below) * (place == 0 || place == last_plane ? 1.0f : 0.5f);
}

/// The difference at a voxel along an axis: voxel_derivative(); beside a voxel without data it is
/// one-sided, between two such voxels 0.
ISO_INLINE float derivative_with_data(float below, float at, float above, int place,
                                      int last_plane) {
  if (ISO_NO_DATA && is_no_data(below)) return is_no_data(above) ? 0.0f : above - at;
  if (ISO_NO_DATA && is_no_data(above)) return at - below;
  return voxel_derivative(below, above, place, last_plane);
}

/// The gradient at a vertex from those of its edge's voxels: the one of smooth_gradient.h.
/// difference: upper voxel minus lower; taken alone if all others vanish.
ISO_INLINE Gradient vertex_gradient(const float *lower, const float *upper, float t, uint axis,
                                    float difference) {
  Gradient g;
  g.x = without_zero_sign(lerp(t, lower[0], upper[0]));
  g.y = without_zero_sign(lerp(t, lower[1], upper[1]));
  g.z = without_zero_sign(lerp(t, lower[2], upper[2]));
  if (is_no_gradient(g)) {
    g.x = axis == 0u ? difference : 0.0f;
    g.y = axis == 1u ? difference : 0.0f;
    g.z = axis == 2u ? difference : 0.0f;
  }
  return g;
}

#define ISO_MESH_NEIGHBOURS 17u /* with gradients; 8 without: itself among them */

/// Does a block's part of a mesh need its neighbour at dx, dy, dz, each -1, 0 or 1? Without
/// gradients those of its dual grid. With them also the blocks before its voxels and before the
/// upper ends of its edges.
ISO_INLINE int mesh_needs_neighbour(int dx, int dy, int dz, int with_gradients) {
  const int num_before = (dx < 0) + (dy < 0) + (dz < 0),
            num_behind = (dx > 0) + (dy > 0) + (dz > 0);
  return num_before == 0 || (with_gradients && num_before == 1 && num_behind < 2);
}

ISO_NAMESPACE_END

#endif
