#pragma once
// What every extracted mesh must be: closed but for the volume's border, each vertex once.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <glm/glm.hpp>
#include <utility>
#include <vector>

#include "core/mesh/mesh.hpp"

namespace isowave::core {

/// Whether two vertices lie in one face of the volume's box [index space].
inline bool on_one_border(const glm::vec3 &a, const glm::vec3 &b, const glm::uvec3 &dims) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const float plane : {0.0f, static_cast<float>(dims[axis] - 1)}) {
      if (a[axis] == plane && b[axis] == plane) return true;
    }
  }
  return false;
}

/// Each edge of a triangle belongs to one other, which runs along it the other way; but for edges
/// in the border of the volume. No vertex is without a triangle.
///
/// mesh  of a volume with spacing 1 and origin 0
inline void expect_closed(const Mesh &mesh, const glm::uvec3 &dims) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  std::vector<bool> used(mesh.vertices.size());
  for (const Triangle &triangle : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      ASSERT_LT(triangle[i], mesh.vertices.size());
      used[triangle[i]] = true;
      edges.emplace_back(triangle[i], triangle[(i + 1) % 3]);
    }
  }
  std::ranges::sort(edges);
  ASSERT_EQ(std::ranges::adjacent_find(edges), edges.end())
      << "two triangles on the same side of an edge";
  std::size_t num_open = 0;
  for (const auto &[from, to] : edges) {
    ASSERT_NE(from, to);
    if (std::ranges::binary_search(edges, std::pair(to, from))) continue;
    ++num_open;
    ASSERT_TRUE(on_one_border(mesh.vertices[from], mesh.vertices[to], dims))
        << "a crack from vertex " << from << " to " << to;
  }
  EXPECT_LE(num_open, 3 * mesh.triangles.size());
  EXPECT_EQ(std::ranges::count(used, false), 0) << "vertices without a triangle";
}

template <class T>
bool same_bytes(const std::vector<T> &a, const std::vector<T> &b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

inline void expect_same_mesh(const Mesh &got, const Mesh &expected) {
  EXPECT_EQ(got.vertices.size(), expected.vertices.size());
  EXPECT_EQ(got.triangles.size(), expected.triangles.size());
  EXPECT_TRUE(same_bytes(got.vertices, expected.vertices)) << "vertices";
  EXPECT_TRUE(same_bytes(got.normals, expected.normals)) << "normals";
  EXPECT_EQ(got.triangles, expected.triangles);
}

}  // namespace isowave::core
