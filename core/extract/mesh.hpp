#pragma once
// Triangle meshes, and who takes one part by part.

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/volume/volume.hpp"
#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

/// Numbers of its vertices, counter-clockwise seen from where values are lower.
using Triangle = std::array<std::uint32_t, 3>;

struct MeshSize {
  std::uint64_t num_vertices = 0, num_triangles = 0;
  bool has_normals = false;
};

/// Some vertices and triangles of a mesh.
struct MeshPart {
  std::span<const glm::vec3> vertices;  ///< world space
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
  std::vector<glm::vec3> vertices, normals;
  std::vector<Triangle> triangles;

  void begin(const MeshSize &size) override;
  void add(const MeshPart &part) override;
};

/// From the index space of a volume to the world.
class MeshPlacement {
 public:
  explicit MeshPlacement(const VolumeInfo &info);

  /// Computed in float64, then rounded.
  ///
  /// block   whose vertex it is
  /// vertex  its edge's bits 0..7 and t are used
  glm::vec3 position(const glm::uvec3 &block, const MeshVertex &vertex) const;
  /// gradient: index space. 0 where that is 0.
  glm::vec3 normal(const Gradient &gradient) const;
  /// Turned round where the volume's axes are left-handed, so that it is seen from the same side.
  Triangle triangle(const MeshTriangle &triangle) const {
    return mirrored_ ? Triangle{triangle.a, triangle.c, triangle.b}
                     : Triangle{triangle.a, triangle.b, triangle.c};
  }

 private:
  glm::dvec3 origin_;
  glm::dmat3 to_world_, gradient_to_world_;
  bool mirrored_;
};

}  // namespace isowave::core
