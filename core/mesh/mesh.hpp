#pragma once
// Triangle meshes, and who takes one part by part.

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/volume/volume.hpp"
#include "core/volume/world_positions.hpp"
#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

/// Numbers of its vertices, counter-clockwise seen from where values are lower.
using Triangle = std::array<std::uint32_t, 3>;

struct MeshSize {
  std::uint64_t num_vertices = 0, num_triangles = 0;
  bool has_normals = false;
};

/// Places of vertices on the edges between voxels.
enum class VertexPlaces {
  /// At least kLeastGap from the edge's voxels. So no two vertices meet, every triangle has an
  /// area, and the mesh stays closed for programs that merge vertices by their positions.
  kApart,
  kExact  ///< at the isovalue itself; vertices meet on a voxel that equals it
};
/// Least distance of a vertex from the voxels of its edge [edge lengths]. Two neighbours that are
/// rounded to float32, each off by kPositionError at most, stay apart.
inline constexpr double kLeastGap = 4 * kPositionError;

/// Some vertices and triangles of a mesh.
struct MeshPart {
  std::span<const glm::dvec3> vertices;  ///< world space, as WorldPositions rounds them
  /// One for each vertex, or none: of length 1, away from larger values, world space.
  std::span<const glm::vec3> normals;
  std::span<const Triangle> triangles;  ///< of vertices of any part, also of a later one
};

/// Takes a mesh: begin(), then the parts in order.
class MeshSink {
 public:
  virtual ~MeshSink() = default;
  virtual void begin(const MeshSize &size) = 0;
  virtual void add(const MeshPart &part) = 0;
};

/// A mesh in memory.
struct Mesh : MeshSink {
  std::vector<glm::dvec3> vertices;
  std::vector<glm::vec3> normals;
  std::vector<Triangle> triangles;

  void begin(const MeshSize &size) override;
  void add(const MeshPart &part) override;
};

/// Takes out vertices without a triangle. The others keep their order.
void drop_unused_vertices(Mesh &mesh);

/// From the index space of a volume to the world.
class MeshPlacement {
 public:
  MeshPlacement(const VolumeInfo &info, VertexPlaces places);

  /// block   whose vertex it is
  /// vertex  its edge's bits 0..7 and t are used
  glm::dvec3 position(const glm::uvec3 &block, const MeshVertex &vertex) const;
  glm::dvec3 position(const glm::uvec3 &voxel) const { return positions_(glm::dvec3(voxel)); }
  /// The unit normal in world space of a gradient in index space; 0 if the gradient is 0.
  glm::vec3 normal(const Gradient &gradient) const;
  /// The triangle, turned round if the volume's axes are left-handed, so that it is seen from the
  /// same side.
  Triangle triangle(const MeshTriangle &triangle) const {
    return mirrored_ ? Triangle{triangle.a, triangle.c, triangle.b}
                     : Triangle{triangle.a, triangle.b, triangle.c};
  }

 private:
  WorldPositions positions_;
  double least_gap_;
  glm::dmat3 gradient_to_world_;
  bool mirrored_;
};

}  // namespace isowave::core
