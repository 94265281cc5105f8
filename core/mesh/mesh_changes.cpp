#include "core/mesh/mesh_changes.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/mesh/closed_mesh.hpp"
#include "core/mesh/largest_parts.hpp"

#ifdef ISOWAVE_HAS_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

namespace isowave::core {

std::string describe(const SimplifiedMesh &mesh) {
  return fmt::format("{} of {} {} left, up to about {:.3g} from the surface", mesh.after,
                     mesh.before, plural(mesh.before, "triangle is", "triangles are"), mesh.error);
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

/// The ends of edges that two triangles run along in the same way.
std::vector<bool> ends_of_shared_edges(const std::vector<Triangle> &triangles,
                                       std::size_t num_vertices) {
  std::vector<std::uint64_t> edges;
  edges.reserve(3 * triangles.size());
  for (const Triangle &triangle : triangles) {
    for (std::size_t i = 0; i < 3; ++i)
      edges.push_back(std::uint64_t{triangle[i]} << 32 | triangle[(i + 1) % 3]);
  }
  std::ranges::sort(edges);
  std::vector<bool> ends(num_vertices);
  for (std::size_t i = 1; i < edges.size(); ++i) {
    if (edges[i] == edges[i - 1]) ends[edges[i] >> 32] = ends[edges[i] & 0xFFFFFFFF] = true;
  }
  return ends;
}

/// Simplifies what is not kept, whose border stays.
///
/// places  [vertex] float32
/// error   gets that of meshoptimizer
std::vector<Triangle> simplified(const std::vector<glm::vec3> &places,
                                 const std::vector<Triangle> &triangles,
                                 const std::vector<bool> &kept, std::size_t target, float *error) {
  constexpr float kMostError = 0.1f;  // of the mesh's extent
  std::vector<Triangle> fixed, rest;
  for (std::size_t i = 0; i < triangles.size(); ++i)
    (kept[i] ? fixed : rest).push_back(triangles[i]);
  if (rest.empty()) return fixed;
  std::vector<Triangle> left(rest.size());
  const std::size_t wanted = target > fixed.size() ? target - fixed.size() : 0;
  const std::size_t num_indices = meshopt_simplify(
      left.data()->data(), rest.data()->data(), 3 * rest.size(), &places[0].x, places.size(),
      sizeof(glm::vec3), 3 * wanted, kMostError, meshopt_SimplifyLockBorder, error);
  left.resize(num_indices / 3);
  left.insert(left.end(), fixed.begin(), fixed.end());
  return left;
}

}  // namespace

SimplifiedMesh simplify(Mesh &mesh, double share) {
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
  const auto target = static_cast<std::size_t>(share * double(mesh.triangles.size()));
  // Where meshoptimizer makes four triangles meet in an edge, what was there is kept.
  std::vector<bool> kept(mesh.triangles.size());
  std::vector<Triangle> left;
  float error = 0;
  for (bool all_apart = false; !all_apart;) {
    left = simplified(places, mesh.triangles, kept, target, &error);
    const std::vector<bool> ends = ends_of_shared_edges(left, mesh.vertices.size());
    all_apart = std::ranges::find(ends, true) == ends.end();
    for (std::size_t i = 0; i < kept.size(); ++i)
      kept[i] = kept[i] || std::ranges::any_of(mesh.triangles[i], [&](auto v) { return ends[v]; });
  }
  mesh.triangles = std::move(left);
  result.after = mesh.triangles.size();
  result.error =
      double{error} * double{meshopt_simplifyScale(&places[0].x, places.size(), sizeof(glm::vec3))};
  drop_unused_vertices(mesh);
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
