#include "core/mesh/mesh_changes.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "core/base/error.hpp"
#include "core/mesh/closed_mesh.hpp"
#include "core/mesh/largest_parts.hpp"

#ifdef ISOWAVE_HAS_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

namespace isowave::core {

std::string describe(const SimplifiedMesh &mesh) {
  return fmt::format("{} of {} triangles are left, up to about {:.3g} from the surface", mesh.after,
                     mesh.before, mesh.error);
}

bool can_simplify() {
#ifdef ISOWAVE_HAS_MESHOPTIMIZER
  return true;
#else
  return false;
#endif
}

void check_changes(const MeshChanges &changes, VertexPlaces places) {
  if (!(changes.simplify > 0 && changes.simplify <= 1))
    throw Error("{} of a mesh's triangles cannot be kept: give a share above 0, up to 1",
                changes.simplify);
  if (changes.simplify < 1 && !can_simplify())
    throw Error("this build simplifies no meshes: it was made without meshoptimizer");
  if (changes.closed && places == VertexPlaces::kExact)
    throw Error("a closed mesh has its vertices apart: leave out exact vertices");
}

#ifdef ISOWAVE_HAS_MESHOPTIMIZER

namespace {

/// Takes out vertices without a triangle.
void drop_unused(Mesh &mesh) {
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

}  // namespace

SimplifiedMesh simplify(Mesh &mesh, double share) {
  constexpr float kMostError = 0.1f;  // of the mesh's extent
  SimplifiedMesh result{mesh.triangles.size(), mesh.triangles.size()};
  if (mesh.triangles.empty()) return result;
  glm::dvec3 least = mesh.vertices.front(), largest = least;
  for (const glm::dvec3 &vertex : mesh.vertices) {
    least = glm::min(least, vertex);
    largest = glm::max(largest, vertex);
  }
  std::vector<glm::vec3> places;  // from the middle on, which float32 holds best
  places.reserve(mesh.vertices.size());
  for (const glm::dvec3 &vertex : mesh.vertices)
    places.emplace_back(vertex - 0.5 * (least + largest));
  const auto target = static_cast<std::size_t>(share * double(mesh.triangles.size())) * 3;
  std::vector<Triangle> left(mesh.triangles.size());
  float error = 0;
  const std::size_t num_indices = meshopt_simplify(
      left.data()->data(), mesh.triangles.data()->data(), 3 * mesh.triangles.size(), &places[0].x,
      places.size(), sizeof(glm::vec3), target, kMostError, meshopt_SimplifyLockBorder, &error);
  left.resize(num_indices / 3);
  mesh.triangles = std::move(left);
  result.after = mesh.triangles.size();
  result.error =
      double{error} * double{meshopt_simplifyScale(&places[0].x, places.size(), sizeof(glm::vec3))};
  drop_unused(mesh);
  return result;
}

#else

SimplifiedMesh simplify(Mesh &, double share) {
  check_changes({.simplify = share}, VertexPlaces::kApart);  // throws
  return {};
}

#endif

SimplifiedMesh give_changed(const CompressedVolume &level, float isovalue, VertexPlaces places,
                            const MeshChanges &changes, MeshSink &sink,
                            const std::function<void(MeshSink &)> &extract) {
  check_changes(changes, places);
  const auto extract_to = [&](MeshSink &to) {
    if (!changes.closed) return extract(to);
    ClosedMesh closed(level, isovalue, to);
    extract(closed);
    closed.finish();
  };
  if (!changes.needs_memory()) {
    extract_to(sink);
    return {};
  }
  Mesh mesh;
  extract_to(mesh);
  if (changes.largest != 0) keep_largest(mesh, changes.largest);
  SimplifiedMesh result{mesh.triangles.size(), mesh.triangles.size()};
  if (changes.simplify < 1) result = simplify(mesh, changes.simplify);
  sink.begin({mesh.vertices.size(), mesh.triangles.size(), !mesh.normals.empty()});
  sink.add({mesh.vertices, mesh.normals, mesh.triangles});
  return result;
}

}  // namespace isowave::core
