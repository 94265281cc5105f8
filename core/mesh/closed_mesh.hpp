#pragma once
// Meshes that are closed where the surface leaves the volume.

#include <cstdint>
#include <memory>

#include "core/mesh/mesh.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Hands a mesh on, and then flat caps on the faces of the volume's box, where voxels are inside:
/// as if values lay below the isovalue all around the volume. Every edge of a triangle then belongs
/// to two.
///
/// Memory: values of a face of the volume at a time, and about 100 bytes for each voxel in its
/// border that is inside or has a neighbour there that is.
class ClosedMesh : public MeshSink {
 public:
  /// volume    that the mesh is extracted from; must outlive this
  /// isovalue  of the mesh, whose vertices are VertexPlaces::kApart
  /// inner     takes the closed mesh; must outlive this
  /// Throws    Error: voxels without data; caps of too many vertices; a file that cannot be read
  ClosedMesh(const CompressedVolume &volume, float isovalue, MeshSink &inner);
  ~ClosedMesh() override;
  ClosedMesh(const ClosedMesh &) = delete;
  ClosedMesh &operator=(const ClosedMesh &) = delete;

  void begin(const MeshSize &size) override;
  void add(const MeshPart &part) override;
  /// Hands on the caps. After the last part.
  void finish();

 private:
  struct Caps;
  std::unique_ptr<Caps> caps_;
  MeshSink &inner_;
  std::uint32_t num_vertices_ = 0;  ///< that were handed on
  bool has_normals_ = false;
};

}  // namespace isowave::core
