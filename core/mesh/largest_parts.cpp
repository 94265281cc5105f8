#include "core/mesh/largest_parts.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

namespace isowave::core {

namespace {

/// The lowest vertex of each vertex's part.
std::vector<std::uint32_t> lowest_of_parts(const Mesh &mesh) {
  std::vector<std::uint32_t> lowest(mesh.vertices.size());
  std::iota(lowest.begin(), lowest.end(), 0u);
  const auto find = [&](std::uint32_t vertex) {
    while (lowest[vertex] != vertex) vertex = lowest[vertex] = lowest[lowest[vertex]];
    return vertex;
  };
  for (const Triangle &triangle : mesh.triangles) {
    for (const std::uint32_t vertex : {triangle[1], triangle[2]}) {
      const std::uint32_t a = find(triangle[0]), b = find(vertex);
      lowest[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::uint32_t vertex = 0; vertex < lowest.size(); ++vertex) lowest[vertex] = find(vertex);
  return lowest;
}

double area_of(const Mesh &mesh, const Triangle &triangle) {
  const glm::dvec3 &at = mesh.vertices[triangle[0]];
  return 0.5 *
         glm::length(glm::cross(mesh.vertices[triangle[1]] - at, mesh.vertices[triangle[2]] - at));
}

}  // namespace

void keep_largest(Mesh &mesh, std::uint64_t count) {
  const std::vector<std::uint32_t> lowest = lowest_of_parts(mesh);
  std::vector<double> areas(mesh.vertices.size());  // of a part, at its lowest vertex
  for (const Triangle &triangle : mesh.triangles)
    areas[lowest[triangle[0]]] += area_of(mesh, triangle);
  std::vector<std::uint32_t> parts;
  for (std::uint32_t vertex = 0; vertex < lowest.size(); ++vertex) {
    if (lowest[vertex] == vertex) parts.push_back(vertex);
  }
  if (parts.size() <= count) return;
  std::ranges::stable_sort(parts, [&](auto a, auto b) { return areas[a] > areas[b]; });
  std::vector<bool> stays(mesh.vertices.size());
  for (const std::uint32_t part : std::span(parts).first(count)) stays[part] = true;
  std::erase_if(mesh.triangles,
                [&](const Triangle &triangle) { return !stays[lowest[triangle[0]]]; });
  drop_unused_vertices(mesh);
}

}  // namespace isowave::core
