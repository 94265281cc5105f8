#pragma once
// What becomes of an extracted mesh before it is handed on: closed, its largest parts, fewer
// triangles.

#include <cstdint>
#include <functional>
#include <string>

#include "core/mesh/mesh.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

struct MeshChanges {
  bool closed = false;        ///< see ClosedMesh
  std::uint64_t largest = 0;  ///< number of parts that are kept, the largest; 0: all
  double simplify = 1;        ///< share of the triangles that is wanted, (0,1]; 1: all

  /// The whole mesh is in memory.
  bool needs_memory() const { return largest != 0 || simplify < 1; }
};

struct SimplifiedMesh {
  std::uint64_t before = 0, after = 0;  ///< triangles
  double error = 0;  ///< about the largest distance from the mesh before [world units]
};

/// A line for users.
std::string describe(const SimplifiedMesh &mesh);

/// Whether this build can simplify meshes: by meshoptimizer.
bool can_simplify();

/// Throws  Error: changes out of range; closed with VertexPlaces::kExact; a build that cannot
///         simplify
void check_changes(const MeshChanges &changes, VertexPlaces places);

/// Takes out vertices, so that about that share of the triangles is left; more if their errors
/// would be larger than a tenth of the mesh. Vertices that are left stay where they are, and so do
/// edges of one triangle. A closed mesh stays closed.
SimplifiedMesh simplify(Mesh &mesh, double share);

/// Gives a surface to a sink, changed.
///
/// level      the volume or level of detail that it is extracted from
/// places     of its vertices
/// extract    gives the surface to a sink
/// Throws     Error: check_changes(), ClosedMesh(); what extract and the sink throw
SimplifiedMesh give_changed(const CompressedVolume &level, float isovalue, VertexPlaces places,
                            const MeshChanges &changes, MeshSink &sink,
                            const std::function<void(MeshSink &)> &extract);

}  // namespace isowave::core
