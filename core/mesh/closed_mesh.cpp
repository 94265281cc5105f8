#include "core/mesh/closed_mesh.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/zfp/voxel_region.hpp"
#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

struct ClosedMesh::Caps {
  /// A corner of a cap: a voxel in the volume's border, by its place among the caps' vertices, or a
  /// vertex of the mesh, by its place among the crossings. The highest bit says which.
  using CapCorner = std::uint32_t;
  static constexpr CapCorner kIsCrossing = CapCorner{1} << 31;

  struct PositionHash {
    std::size_t operator()(const glm::dvec3 &position) const {
      std::uint64_t hash = 0;
      for (const double part : {position.x, position.y, position.z}) {
        hash = (hash ^ std::bit_cast<std::uint64_t>(part + 0.0)) * 0x9E3779B97F4A7C15u;  // no -0
        hash ^= hash >> 29;
      }
      return static_cast<std::size_t>(hash);
    }
  };

  Caps(const CompressedVolume &of, float at)
      : volume(of), dims(of.info.dims), isovalue(at), placement(of.info, VertexPlaces::kApart) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool upper : {false, true}) add_face(axis, upper);
    }
    if (vertices.size() >= kIsCrossing || crossings.size() >= kIsCrossing)
      throw Error(
          "the caps of a closed mesh have too many vertices: take a coarser level of detail");
    places_of_voxels = {};
    places_of_edges = {};
  }

  /// Adds the caps on a face of the volume's box.
  void add_face(int axis, bool upper) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    VoxelRegion region{glm::uvec3(0), dims};
    region.begin[axis] = upper ? dims[axis] - 1 : 0;
    region.end[axis] = region.begin[axis] + 1;
    std::vector<float> values(std::size_t{dims[u]} * dims[v]);
    decode_region(volume, region, values);
    // Values lie in the order of the axes, so the lower one of u and v comes first.
    const std::size_t step_u = u < v ? 1 : dims[v], step_v = u < v ? dims[u] : 1;
    glm::uvec3 voxel = region.begin;
    for (voxel[v] = 0; voxel[v] + 1 < dims[v]; ++voxel[v]) {
      for (voxel[u] = 0; voxel[u] + 1 < dims[u]; ++voxel[u]) {
        const std::size_t at = voxel[u] * step_u + voxel[v] * step_v;
        glm::uvec3 along_u = voxel, along_v = voxel, across = voxel;
        ++along_u[u];
        ++along_v[v];
        across = along_u;
        ++across[v];
        // Counter-clockwise, seen from outside.
        std::array<Corner, 4> corners{{{voxel, values[at]},
                                       {along_u, values[at + step_u]},
                                       {across, values[at + step_u + step_v]},
                                       {along_v, values[at + step_v]}}};
        if (!upper) std::swap(corners[1], corners[3]);
        add_square(corners, axis, upper);
      }
    }
  }

  struct Corner {
    glm::uvec3 voxel;
    float value;
  };

  bool is_inside(const Corner &corner) const { return corner.value - isovalue >= 0.0f; }

  /// Adds the caps of a square of four voxels. As in cell_loops(), each group of inside corners
  /// lies between two crossed edges, so that caps end where the mesh does.
  void add_square(const std::array<Corner, 4> &corners, int axis, bool upper) {
    const auto at = [&](std::size_t i) -> const Corner & { return corners.at(i % 4); };
    bool all_inside = true;
    for (std::size_t i = 0; i < 4; ++i) {
      all_inside = all_inside && is_inside(at(i));
      if (is_inside(at(i)) || !is_inside(at(i + 1))) continue;
      std::vector<CapCorner> around{crossing(at(i), at(i + 1))};
      std::size_t last = i + 1;
      for (; is_inside(at(last)); ++last) around.push_back(vertex(at(last).voxel, axis, upper));
      around.push_back(crossing(at(last), at(last - 1)));
      add_fan(around);
    }
    if (!all_inside) return;
    std::vector<CapCorner> around;
    around.reserve(corners.size());
    for (const Corner &corner : corners) around.push_back(vertex(corner.voxel, axis, upper));
    add_fan(around);
  }

  void add_fan(const std::vector<CapCorner> &around) {
    for (std::size_t i = 2; i < around.size(); ++i)
      triangles.push_back({around[0], around[i - 1], around[i]});
  }

  std::uint64_t number_of(const glm::uvec3 &voxel) const {
    return voxel.x + std::uint64_t{dims.x} * (voxel.y + std::uint64_t{dims.y} * voxel.z);
  }

  /// The vertex at a voxel that is inside, in a face of the box.
  CapCorner vertex(const glm::uvec3 &voxel, int axis, bool upper) {
    const auto [found, is_new] =
        places_of_voxels.try_emplace(number_of(voxel), static_cast<CapCorner>(vertices.size()));
    if (is_new) {
      vertices.push_back(placement.position(voxel));
      outward.emplace_back(0);
    }
    outward[found->second][axis] = upper ? 1.0f : -1.0f;
    return found->second;
  }

  /// The mesh's vertex between a voxel that is inside and one that is not, in any order.
  CapCorner crossing(const Corner &a, const Corner &b) {
    const bool a_is_lower = glm::all(glm::lessThanEqual(a.voxel, b.voxel));
    const Corner &lower = a_is_lower ? a : b, &higher = a_is_lower ? b : a;
    const glm::uvec3 step = higher.voxel - lower.voxel;
    const uint axis = step.x != 0 ? 0 : step.y != 0 ? 1 : 2;
    const auto [found, is_new] = places_of_edges.try_emplace(
        3 * number_of(lower.voxel) + axis, static_cast<CapCorner>(crossings.size()));
    if (is_new) {
      const glm::uvec3 block = lower.voxel / 4u, within = lower.voxel % 4u;
      const MeshVertex vertex{axis << 6 | (within.x + 4 * within.y + 16 * within.z),
                              edge_crossing(lower.value, higher.value, isovalue)};
      places_of_positions.emplace(placement.position(block, vertex), found->second);
      crossings.push_back(std::numeric_limits<std::uint32_t>::max());
    }
    return found->second | kIsCrossing;
  }

  const CompressedVolume &volume;
  glm::uvec3 dims;
  float isovalue;
  MeshPlacement placement;
  std::vector<glm::dvec3> vertices;      ///< at voxels
  std::vector<glm::vec3> outward;        ///< [vertex] sum of its faces' directions, index space
  std::vector<std::uint32_t> crossings;  ///< numbers of the mesh's vertices, once these have come
  std::vector<std::array<CapCorner, 3>> triangles;
  std::unordered_map<glm::dvec3, CapCorner, PositionHash> places_of_positions;
  std::unordered_map<std::uint64_t, CapCorner> places_of_voxels, places_of_edges;
};

ClosedMesh::ClosedMesh(const CompressedVolume &volume, float isovalue, MeshSink &inner)
    : inner_(inner) {
  if (!volume.no_data.empty())
    throw Error(
        "a surface beside voxels without data has no other side to be closed on: extract it "
        "as it is");
  caps_ = std::make_unique<Caps>(volume, isovalue);
}

ClosedMesh::~ClosedMesh() = default;

void ClosedMesh::begin(const MeshSize &size) {
  has_normals_ = size.has_normals;
  const MeshSize closed{size.num_vertices + caps_->vertices.size(),
                        size.num_triangles + caps_->triangles.size(), size.has_normals};
  if (closed.num_vertices > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        "the closed surface has {} vertices, more than triangles of 32-bit numbers can name: take "
        "a "
        "coarser level of detail",
        closed.num_vertices);
  inner_.begin(closed);
}

void ClosedMesh::add(const MeshPart &part) {
  for (const glm::dvec3 &position : part.vertices) {
    const auto found = caps_->places_of_positions.find(position);
    if (found != caps_->places_of_positions.end()) caps_->crossings[found->second] = num_vertices_;
    ++num_vertices_;
  }
  inner_.add(part);
}

void ClosedMesh::finish() {
  const auto number_of = [&](Caps::CapCorner corner) {
    if ((corner & Caps::kIsCrossing) == 0) return num_vertices_ + corner;
    const std::uint32_t vertex = caps_->crossings[corner & ~Caps::kIsCrossing];
    if (vertex == std::numeric_limits<std::uint32_t>::max())
      throw std::logic_error("a cap ends at a vertex that the mesh has not");
    return vertex;
  };
  std::vector<Triangle> triangles;
  triangles.reserve(caps_->triangles.size());
  for (const auto &[a, b, c] : caps_->triangles)
    triangles.push_back(caps_->placement.triangle({number_of(a), number_of(b), number_of(c)}));
  std::vector<glm::vec3> normals;
  if (has_normals_) {
    normals.reserve(caps_->outward.size());
    for (const glm::vec3 &outward : caps_->outward)  // values fall outwards
      normals.push_back(caps_->placement.normal({-outward.x, -outward.y, -outward.z}));
  }
  inner_.add({caps_->vertices, normals, triangles});
}

}  // namespace isowave::core
