#include "core/mesh/mesh.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace isowave::core {

void Mesh::begin(const MeshSize &size) {
  vertices.clear();
  normals.clear();
  triangles.clear();
  vertices.reserve(size.num_vertices);
  if (size.has_normals) normals.reserve(size.num_vertices);
  triangles.reserve(size.num_triangles);
}

void Mesh::add(const MeshPart &part) {
  vertices.insert(vertices.end(), part.vertices.begin(), part.vertices.end());
  normals.insert(normals.end(), part.normals.begin(), part.normals.end());
  triangles.insert(triangles.end(), part.triangles.begin(), part.triangles.end());
}

void drop_unused_vertices(Mesh &mesh) {
  constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> numbers(mesh.vertices.size(), kUnused);
  for (const Triangle &triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) numbers[vertex] = 0;
  }
  std::uint32_t next = 0;
  for (std::size_t vertex = 0; vertex < numbers.size(); ++vertex) {
    if (numbers[vertex] == kUnused) continue;
    mesh.vertices[next] = mesh.vertices[vertex];
    if (!mesh.normals.empty()) mesh.normals[next] = mesh.normals[vertex];
    numbers[vertex] = next++;
  }
  mesh.vertices.resize(next);
  if (!mesh.normals.empty()) mesh.normals.resize(next);
  for (Triangle &triangle : mesh.triangles) {
    for (std::uint32_t &vertex : triangle) vertex = numbers[vertex];
  }
}

MeshPlacement::MeshPlacement(const VolumeInfo &info, VertexPlaces places)
    : positions_(info),
      least_gap_(places == VertexPlaces::kApart ? kLeastGap : 0),
      gradient_to_world_(glm::transpose(glm::inverse(info.index_to_world()))),
      mirrored_(glm::determinant(info.index_to_world()) < 0) {}

glm::dvec3 MeshPlacement::position(const glm::uvec3 &block, const MeshVertex &vertex) const {
  const glm::uvec3 voxel(vertex.edge & 3u, vertex.edge >> 2 & 3u, vertex.edge >> 4 & 3u);
  glm::dvec3 index(4u * block + voxel);
  index[static_cast<int>(vertex.edge >> 6 & 3u)] +=
      std::clamp(double{vertex.t}, least_gap_, 1 - least_gap_);
  return positions_(index);
}

glm::vec3 MeshPlacement::normal(const Gradient &gradient) const {
  glm::dvec3 direction(gradient.x, gradient.y, gradient.z);
  const double largest =
      std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
  if (!(largest > 0) || std::isinf(largest)) return glm::vec3(0);
  direction = gradient_to_world_ * (direction / largest);
  return glm::vec3(-direction / glm::length(direction));
}

}  // namespace isowave::core
