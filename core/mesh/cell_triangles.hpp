#pragma once
// The triangles that marching cubes makes of a cell, by the signs of its corners: a table that is
// made from a rule, for kernels and their twin.
//
// On each face, the surface runs around each group of neighbouring inside corners. If two inside
// corners lie across from each other, the surface separates them. Both cells of a face see the same
// corners, so they agree, and the surface has no crack. The lines of the six faces join to closed
// loops. Each loop is cut into triangles, never by a line that lies in a face: the neighbour might
// have the same line, and more than two triangles would share it.
//
// The rule is that of VTK's tables: the same loops, and so as many triangles for all 256 signs.

#include <array>
#include <cstdint>
#include <vector>

#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

/// The loops of edges around which a cell with these signs (bit x + 2y + 4z: that corner is inside)
/// is filled with triangles; counter-clockwise seen from outside. Edges are those of
/// kernels_cl/portable/marching_cubes.h.
std::vector<std::vector<std::uint32_t>> cell_loops(std::uint32_t signs);

/// [256 * ISO_CASE_BYTES] of each signs: how many triangles, then three edges of each.
using CellTriangles = std::array<uchar, 256 * ISO_CASE_BYTES>;
/// Made at the first call.
const CellTriangles &cell_triangles();

}  // namespace isowave::core
