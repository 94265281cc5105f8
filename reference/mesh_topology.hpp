#pragma once
// The topology of meshes: their parts that hang together, Euler's characteristic, and which parts
// of one mesh another one lacks. It judges what fewer bits and coarser levels of detail do to thin
// and small structures.

#include <cstdint>
#include <vector>

#include "core/mesh/mesh.hpp"

namespace isowave::core {

/// Connected components of a mesh.
struct MeshComponents {
  std::vector<std::uint32_t> of_vertex;      ///< component of each vertex
  std::vector<std::uint64_t> num_triangles;  ///< by component
  /// Vertices - edges + triangles: 2 for each closed component, and 2 less for each of its handles.
  std::int64_t euler = 0;

  std::size_t count() const { return num_triangles.size(); }
};

MeshComponents components_of(const Mesh &mesh);

/// Components of a mesh that another mesh of the same volume lacks: none of the other's vertices is
/// near any vertex of such a component.
///
/// info   grid of the volume
/// reach  size of the cells, in voxels of that grid, in which, or beside which, a vertex is near
/// Returns  for each component of `mesh`, whether the other one lacks it
std::vector<bool> lacking(const Mesh &mesh, const MeshComponents &components, const Mesh &other,
                          const VolumeInfo &info, double reach);

}  // namespace isowave::core
