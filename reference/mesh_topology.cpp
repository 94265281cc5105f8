#include "reference/mesh_topology.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_set>

namespace isowave::core {

namespace {

/// Sets of numbers that are united two by two.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parents_(count) {
    std::iota(parents_.begin(), parents_.end(), 0u);
  }

  std::uint32_t root(std::uint32_t i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }

  void unite(std::uint32_t a, std::uint32_t b) { parents_[root(a)] = root(b); }

 private:
  std::vector<std::uint32_t> parents_;
};

std::uint64_t count_edges(const std::vector<Triangle> &triangles) {
  std::vector<std::uint64_t> edges;
  edges.reserve(3 * triangles.size());
  for (const Triangle &triangle : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(triangle[i], triangle[(i + 1) % 3]);
      edges.push_back(std::uint64_t{low} << 32 | high);
    }
  }
  std::ranges::sort(edges);
  return static_cast<std::uint64_t>(std::unique(edges.begin(), edges.end()) - edges.begin());
}

/// Cells of a grid, each a number.
class Cells {
 public:
  Cells(const VolumeInfo &info, double reach)
      : origin_(info.origin), to_index_(glm::inverse(info.index_to_world())), reach_(reach) {}

  glm::i64vec3 cell_of(const glm::dvec3 &vertex) const {
    return glm::i64vec3(glm::floor(to_index_ * (vertex - origin_) / reach_)) + std::int64_t{2};
  }
  static std::uint64_t number(const glm::i64vec3 &cell) {
    return static_cast<std::uint64_t>(cell.x) | static_cast<std::uint64_t>(cell.y) << 20 |
           static_cast<std::uint64_t>(cell.z) << 40;
  }

 private:
  glm::dvec3 origin_;
  glm::dmat3 to_index_;
  double reach_;
};

bool is_beside(const std::unordered_set<std::uint64_t> &cells, const glm::i64vec3 &cell) {
  for (std::int64_t i = 0; i < 27; ++i) {
    const glm::i64vec3 beside = cell + glm::i64vec3(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    if (cells.contains(Cells::number(beside))) return true;
  }
  return false;
}

}  // namespace

MeshComponents components_of(const Mesh &mesh) {
  DisjointSets sets(mesh.vertices.size());
  for (const Triangle &triangle : mesh.triangles) {
    sets.unite(triangle[0], triangle[1]);
    sets.unite(triangle[1], triangle[2]);
  }
  MeshComponents components;
  constexpr std::uint32_t kNone = UINT32_MAX;
  std::vector<std::uint32_t> of_root(mesh.vertices.size(), kNone);
  for (std::uint32_t vertex = 0; vertex < mesh.vertices.size(); ++vertex) {
    std::uint32_t &component = of_root[sets.root(vertex)];
    if (component == kNone) {
      component = static_cast<std::uint32_t>(components.num_triangles.size());
      components.num_triangles.push_back(0);
    }
    components.of_vertex.push_back(component);
  }
  for (const Triangle &triangle : mesh.triangles)
    ++components.num_triangles[components.of_vertex[triangle[0]]];
  components.euler = static_cast<std::int64_t>(mesh.vertices.size()) -
                     static_cast<std::int64_t>(count_edges(mesh.triangles)) +
                     static_cast<std::int64_t>(mesh.triangles.size());
  return components;
}

std::vector<bool> lacking(const Mesh &mesh, const MeshComponents &components, const Mesh &other,
                          const VolumeInfo &info, double reach) {
  const Cells grid(info, reach);
  std::unordered_set<std::uint64_t> cells;
  for (const glm::dvec3 &vertex : other.vertices) cells.insert(Cells::number(grid.cell_of(vertex)));
  std::vector<bool> lacks(components.count(), true);
  for (std::size_t vertex = 0; vertex < mesh.vertices.size(); ++vertex) {
    const std::uint32_t component = components.of_vertex[vertex];
    if (lacks[component] && is_beside(cells, grid.cell_of(mesh.vertices[vertex])))
      lacks[component] = false;
  }
  return lacks;
}

}  // namespace isowave::core
