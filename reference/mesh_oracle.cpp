#include "reference/mesh_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/error.hpp"
#include "reference/embree_reach.hpp"
#include "reference/embree_scene.hpp"

namespace isowave::core {

namespace {

constexpr std::uint32_t kNoVertex = std::numeric_limits<std::uint32_t>::max();

// The nodes of a cell's tetrahedra: corners x + 2y + 4z, then face centres (axis, low or high
// side), then the centre.
constexpr unsigned kNumNodes = 15, kFaceNode = 8, kCentreNode = 14;
constexpr unsigned kNumTetrahedra = 24;
// Edges that cells share belong to a voxel: three to the next voxels, and four spokes of each of
// its three lower faces.
constexpr unsigned kEdgesPerVoxel = 15;
constexpr double kCellDiagonal = 1.7320508075688772;

using Node = std::array<int, 3>;  ///< half voxels from the cell's lower corner, 0..2

Node node_place(unsigned node) {
  if (node == kCentreNode) return {1, 1, 1};
  if (node < kFaceNode)
    return {static_cast<int>(2 * (node & 1)), static_cast<int>(node & 2),
            static_cast<int>(node >> 2 << 1)};
  Node place{1, 1, 1};
  place[(node - kFaceNode) / 2] = static_cast<int>((node - kFaceNode) % 2 * 2);
  return place;
}

/// Place in which the vertex of an edge is kept: at a voxel, or only while its cell is worked on.
struct EdgeSlot {
  bool shared = false;
  std::array<unsigned char, 3> voxel{};  ///< shared: the owner, relative to the cell
  unsigned slot = 0;  ///< of kEdgesPerVoxel, or else of kNumNodes: the end that is not the centre
};

EdgeSlot slot_of(unsigned a, unsigned b) {
  if (a > b) std::swap(a, b);
  EdgeSlot edge;
  if (b == kCentreNode) {
    edge.slot = a;
    return edge;
  }
  edge.shared = true;
  const auto set_owner = [&](unsigned corner) {
    for (unsigned axis = 0; axis < 3; ++axis) edge.voxel[axis] = corner >> axis & 1u;
  };
  if (b < kFaceNode) {  // a's bits are a subset of b's
    set_owner(a);
    edge.slot = static_cast<unsigned>((b - a) >> 1);  // 1, 2, 4 -> axis
    return edge;
  }
  const unsigned axis = (b - kFaceNode) / 2, side = (b - kFaceNode) % 2;
  set_owner(side << axis);
  const unsigned spoke = (a >> (axis + 1) % 3 & 1u) + 2 * (a >> (axis + 2) % 3 & 1u);
  edge.slot = 3 + 4 * axis + spoke;
  return edge;
}

/// The tetrahedra of a cell, positively oriented, and the slots of all edges between their nodes.
struct CellTables {
  std::array<std::array<unsigned, 4>, kNumTetrahedra> tetrahedra;
  std::array<std::array<EdgeSlot, kNumNodes>, kNumNodes> slots;
  std::array<Node, kNumNodes> places;

  CellTables() {
    for (unsigned node = 0; node < kNumNodes; ++node) places[node] = node_place(node);
    unsigned count = 0;
    for (unsigned face = 0; face < 6; ++face) {
      const unsigned axis = face / 2, side = face % 2, b = (axis + 1) % 3, c = (axis + 2) % 3;
      for (unsigned i = 0; i < 4;
           ++i) {  // around the face, counter-clockwise as seen from the axis' end
        const auto corner = [&](unsigned k) {
          return side << axis | unsigned(k == 1 || k == 2) << b | unsigned(k == 2 || k == 3) << c;
        };
        std::array<unsigned, 4> &nodes = tetrahedra[count++];
        nodes = {kCentreNode, kFaceNode + face, corner(i), corner((i + 1) % 4)};
        if (side == 0) std::swap(nodes[2], nodes[3]);
        for (const unsigned from : nodes) {
          for (const unsigned to : nodes) {
            if (from != to) slots[from][to] = slot_of(from, to);
          }
        }
      }
    }
  }
};

/// Even permutations of a tetrahedron's nodes by the mask of those inside: they come first.
struct InsideFirst {
  unsigned num_inside;
  std::array<unsigned, 4> order;
};
constexpr std::array<InsideFirst, 16> kInsideFirst{
    {{0, {0, 1, 2, 3}},
     {1, {0, 1, 2, 3}},
     {1, {1, 0, 3, 2}},
     {2, {0, 1, 2, 3}},
     {1, {2, 0, 1, 3}},
     {2, {0, 2, 3, 1}},
     {2, {1, 2, 0, 3}},
     {3, {3, 0, 2, 1}},  // one outside: it comes first
     {1, {3, 0, 2, 1}},
     {2, {0, 3, 1, 2}},
     {2, {1, 3, 2, 0}},
     {3, {2, 0, 1, 3}},
     {2, {2, 3, 0, 1}},
     {3, {1, 0, 3, 2}},
     {3, {0, 1, 2, 3}},
     {4, {0, 1, 2, 3}}}};

/// One pass over the cells, layer by layer; the vertices of two layers of voxels are remembered.
class Extraction {
 public:
  Extraction(std::span<const float> voxels, std::array<std::uint32_t, 3> dims, float isovalue)
      : voxels_(voxels), dims_(dims), isovalue_(isovalue) {
    const std::size_t layer = std::size_t{dims[0]} * dims[1] * kEdgesPerVoxel;
    lower_.assign(layer, kNoVertex);
    upper_.assign(layer, kNoVertex);
  }

  IsoMesh run() {
    for (cell_[2] = 0; cell_[2] + 1 < dims_[2]; ++cell_[2]) {
      for (cell_[1] = 0; cell_[1] + 1 < dims_[1]; ++cell_[1]) {
        for (cell_[0] = 0; cell_[0] + 1 < dims_[0]; ++cell_[0]) add_cell();
      }
      lower_.swap(upper_);
      std::fill(upper_.begin(), upper_.end(), kNoVertex);
    }
    return std::move(mesh_);
  }

 private:
  void add_cell() {
    if (!load_cell()) return;
    inner_.fill(kNoVertex);
    for (const auto &nodes : tables_.tetrahedra) {
      unsigned mask = 0;
      for (unsigned i = 0; i < 4; ++i) mask |= unsigned(values_[nodes[i]] >= 0) << i;
      const auto &[num_inside, order] = kInsideFirst[mask];
      if (num_inside == 0 || num_inside == 4) continue;
      const unsigned i = nodes[order[0]], j = nodes[order[1]], k = nodes[order[2]],
                     l = nodes[order[3]];
      if (num_inside == 1) add_triangle(vertex(i, j), vertex(i, k), vertex(i, l));
      if (num_inside == 3) add_triangle(vertex(i, j), vertex(i, l), vertex(i, k));
      if (num_inside == 2) {
        add_triangle(vertex(i, k), vertex(i, l), vertex(j, l));
        add_triangle(vertex(i, k), vertex(j, l), vertex(j, k));
      }
    }
    if (mesh_.triangles.size() > kMaxTriangles) {
      throw Error("the isosurface has more than {} triangles: too many for the mesh oracle",
                  kMaxTriangles);
    }
  }

  /// Values minus the isovalue at the nodes; false for a cell that the surface does not pass
  /// through.
  bool load_cell() {
    unsigned num_inside = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const std::size_t x = cell_[0] + (corner & 1u), y = cell_[1] + (corner >> 1 & 1u),
                        z = cell_[2] + (corner >> 2);
      values_[corner] = voxels_[x + dims_[0] * (y + std::size_t{dims_[1]} * z)] - isovalue_;
      num_inside += values_[corner] >= 0;
    }
    if (num_inside == 0 || num_inside == 8) return false;
    for (unsigned face = 0; face < 6; ++face) {
      double sum = 0;  // of the corners in ascending order: the same bits from both cells
      for (unsigned corner = 0; corner < 8; ++corner) {
        if ((corner >> face / 2 & 1u) == face % 2) sum += values_[corner];
      }
      values_[kFaceNode + face] = sum / 4;
    }
    double sum = 0;
    for (unsigned corner = 0; corner < 8; ++corner) sum += values_[corner];
    values_[kCentreNode] = sum / 8;
    return true;
  }

  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    mesh_.triangles.push_back({a, b, c});
  }

  /// The vertex between an inside and an outside node; the order does not matter.
  std::uint32_t vertex(unsigned a, unsigned b) {
    const EdgeSlot &edge = tables_.slots[a][b];
    std::uint32_t &index = edge.shared ? shared(edge) : inner_[edge.slot];
    if (index != kNoVertex) return index;
    if (values_[a] < 0) std::swap(a, b);
    const double s = values_[a] / (values_[a] - values_[b]);
    std::array<float, 3> place;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const int from = tables_.places[a][axis], to = tables_.places[b][axis];
      place[axis] = static_cast<float>(cell_[axis] + 0.5 * (from + s * (to - from)));
    }
    index = static_cast<std::uint32_t>(mesh_.vertices.size());
    mesh_.vertices.push_back(place);
    return index;
  }

  std::uint32_t &shared(const EdgeSlot &edge) {
    const std::size_t x = cell_[0] + edge.voxel[0], y = cell_[1] + edge.voxel[1];
    return (edge.voxel[2] != 0 ? upper_ : lower_)[(x + dims_[0] * y) * kEdgesPerVoxel + edge.slot];
  }

  const CellTables tables_;
  std::span<const float> voxels_;
  std::array<std::uint32_t, 3> dims_;
  double isovalue_;
  std::array<std::uint32_t, 3> cell_{};
  std::array<double, kNumNodes> values_{};
  std::array<std::uint32_t, kNumNodes> inner_{};
  std::vector<std::uint32_t> lower_, upper_;  ///< [ny][nx][kEdgesPerVoxel]
  IsoMesh mesh_;
};

}  // namespace

IsoMesh extract_isosurface(std::span<const float> voxels, std::array<std::uint32_t, 3> dims,
                           float isovalue) {
  if (voxels.size() != std::size_t{dims[0]} * dims[1] * dims[2] ||
      *std::min_element(dims.begin(), dims.end()) < 2) {
    throw std::invalid_argument("extract_isosurface: the voxels do not fit the dims");
  }
  return Extraction(voxels, dims, isovalue).run();
}

std::uint64_t num_open_edges(const IsoMesh &mesh) {
  // Each directed edge once, as (lower vertex, higher vertex, direction): an edge is closed when it
  // is there in both.
  std::vector<std::array<std::uint32_t, 3>> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const auto &triangle : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t from = triangle[i], to = triangle[(i + 1) % 3];
      edges.push_back({std::min(from, to), std::max(from, to), from < to});
    }
  }
  std::sort(edges.begin(), edges.end());
  std::uint64_t open = 0;
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    const auto same_edge = [&](std::size_t i) {
      return edges[i][0] == edges[begin][0] && edges[i][1] == edges[begin][1];
    };
    while (end < edges.size() && same_edge(end)) ++end;
    open += !(end - begin == 2 && edges[begin][2] != edges[begin + 1][2]);
  }
  return open;
}

/// Triangles in an Embree scene.
class TracedMesh {
 public:
  explicit TracedMesh(IsoMesh mesh) : mesh_(std::move(mesh)), scene_(true) {
    const std::size_t num_vertices = mesh_.vertices.size();
    mesh_.vertices.push_back({});
    RTCGeometry geometry = rtcNewGeometry(scene_.device(), RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               mesh_.vertices.data(), 0, sizeof mesh_.vertices[0], num_vertices);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                               mesh_.triangles.data(), 0, sizeof mesh_.triangles[0],
                               mesh_.triangles.size());
    scene_.build(geometry);
  }

  /// t of the first triangle behind t = `from`, infinity for none.
  double first_hit(const OracleRay &ray, double from = 0) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit embree = to_embree(ray);
    embree.ray.tnear = static_cast<float>(from);
    rtcIntersect1(scene_.scene(), &context, &embree);
    return embree.hit.geomID == RTC_INVALID_GEOMETRY_ID ? kInfinity : embree.ray.tfar;
  }

  std::uint64_t num_triangles() const { return mesh_.triangles.size(); }

 private:
  IsoMesh mesh_;  ///< Embree reads it in place; one vertex more, so that it may read 16 bytes at
                  ///< the last
  EmbreeScene scene_;
};

namespace {

std::array<double, 3> on_ray(const OracleRay &ray, double t) {
  return {ray.origin[0] + t * ray.direction[0], ray.origin[1] + t * ray.direction[1],
          ray.origin[2] + t * ray.direction[2]};
}

}  // namespace

/// A box of points `spacing` voxels apart, numbered from the volume's origin: [begin, begin +
/// count) along each axis.
struct FineGrid {
  double spacing;
  std::array<std::int64_t, 3> begin{};
  std::array<std::uint32_t, 3> count{};

  /// kHalfWidth points to each side of `centre`, as far as the domain reaches.
  FineGrid(double spacing_in, const std::array<double, 3> &centre,
           const std::array<std::uint32_t, 3> &dims)
      : spacing(spacing_in) {
    constexpr std::int64_t kHalfWidth = 9;  // more than sqrt(3) voxels at a spacing of 1/4
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto last = static_cast<std::int64_t>((dims[axis] - 1) / spacing);
      const std::int64_t middle =
          std::clamp(static_cast<std::int64_t>(centre[axis] / spacing), std::int64_t{0}, last);
      begin[axis] = std::max(std::int64_t{0}, middle - kHalfWidth);
      count[axis] =
          static_cast<std::uint32_t>(std::min(last, middle + kHalfWidth) - begin[axis] + 1);
    }
  }

  double place(std::size_t axis, std::uint32_t i) const {
    return spacing * static_cast<double>(begin[axis] + i);
  }
  /// The ray from its point at `t` on, in units of the grid; one unit of t is what it was.
  OracleRay local(const OracleRay &ray, double t) const {
    OracleRay result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      result.origin[axis] = (ray.origin[axis] + t * ray.direction[axis] - place(axis, 0)) / spacing;
      result.direction[axis] = ray.direction[axis] / spacing;
    }
    return result;
  }
};

MeshOracle::MeshOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims,
                       float isovalue)
    : voxels_(voxels),
      dims_(dims),
      isovalue_(isovalue),
      mesh_(std::make_unique<TracedMesh>(extract_isosurface(voxels, dims, isovalue))) {}

MeshOracle::~MeshOracle() = default;

std::uint64_t MeshOracle::num_triangles() const {
  return mesh_->num_triangles();
}

double MeshOracle::first_hit(const OracleRay &ray, double from) const {
  if (!within_embree_reach(ray.origin, dims_)) {
    throw std::invalid_argument("MeshOracle: " + out_of_reach(ray.origin, dims_));
  }
  return mesh_->first_hit(ray, from);
}

/// The trilinear field minus the isovalue.
double MeshOracle::value(const std::array<double, 3> &point) const {
  std::array<std::size_t, 3> cell;
  std::array<double, 3> p;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cell[axis] =
        static_cast<std::size_t>(std::clamp(std::floor(point[axis]), 0.0, dims_[axis] - 2.0));
    p[axis] = point[axis] - static_cast<double>(cell[axis]);
  }
  double sum = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const std::size_t x = cell[0] + (corner & 1u), y = cell[1] + (corner >> 1 & 1u),
                      z = cell[2] + (corner >> 2);
    const double weight = ((corner & 1u) != 0 ? p[0] : 1 - p[0]) *
                          ((corner & 2u) != 0 ? p[1] : 1 - p[1]) *
                          ((corner & 4u) != 0 ? p[2] : 1 - p[2]);
    sum += weight * (voxels_[x + dims_[0] * (y + std::size_t{dims_[1]} * z)] - isovalue_);
  }
  return sum;
}

/// The triangles of the field at the points of a fine grid, in its units.
TracedMesh MeshOracle::refined(const FineGrid &grid) const {
  std::vector<float> values;
  values.reserve(std::size_t{grid.count[0]} * grid.count[1] * grid.count[2]);
  for (std::uint32_t z = 0; z < grid.count[2]; ++z) {
    for (std::uint32_t y = 0; y < grid.count[1]; ++y) {
      for (std::uint32_t x = 0; x < grid.count[0]; ++x) {
        values.push_back(
            static_cast<float>(value({grid.place(0, x), grid.place(1, y), grid.place(2, z)})));
      }
    }
  }
  return TracedMesh(extract_isosurface(values, grid.count, 0));
}

std::optional<double> MeshOracle::agrees_refined(const OracleRay &ray, const RendererHit &got,
                                                 double from, double at) const {
  const double speed = speed_of(ray);
  for (const double spacing : {1.0 / 4, 1.0 / 16, 1.0 / 64, 1.0 / 256}) {
    const FineGrid grid(spacing, on_ray(ray, at), dims_);
    const TracedMesh mesh = refined(grid);
    // From just before the grid, whose diagonal is 31 spacings: the fine ray's float32 numbers are
    // small.
    const double start = std::max(from, at - 40 * spacing / speed);
    // The part of the ray that is in the grid for certain; the grid ends at the domain's border, a
    // false hit may not.
    const double reach = 8 * spacing / speed;
    const auto agrees = [&](double t) {
      if (t == kInfinity) return !(got.hit && std::abs(got.t - at) <= reach);
      return got.hit && std::abs(start + t - got.t) * speed <= 4 * spacing * kCellDiagonal;
    };
    const OracleRay fine = grid.local(ray, start);
    const double t = mesh.first_hit(fine);
    bool agreed = agrees(t);
    if (spacing == 1.0 / 256) {
      for (const double offset : {0.5, 1.0}) {  // spacings
        for (int i = 0; i < 8 && !agreed; ++i)
          agreed = agrees(mesh.first_hit(moved_sideways(fine, offset, i)));
      }
    }
    if (agreed) return at + reach;
    at = got.hit ? std::min(start + t, got.t) : start + t;
  }
  return std::nullopt;
}

void judge(const MeshOracle &oracle, const FrameParams &frame, const Ray &ray,
           const HitRecord &record, Accuracy &tally) {
  const OracleRay exact = exact_ray(ray);
  const RendererHit got = renderer_hit(frame, exact, record);
  const double t_got = got.hit ? got.t : kInfinity, speed = speed_of(exact);
  double t_mesh = oracle.first_hit(exact);
  const auto agrees = [&] {
    return t_mesh == t_got || std::abs(t_mesh - t_got) * speed <= kCellDiagonal;
  };
  ++tally.rays;
  tally.hits += std::isfinite(t_mesh);
  if (got.hit && !place_fits(frame, exact, record, got)) ++tally.wrong_places;
  if (std::isnan(t_got)) return;
  if (agrees()) {
    if (got.hit) tally.distance.push_back(std::abs(t_mesh - t_got) * speed);
    return;
  }
  double from = 0;
  while (!agrees()) {
    const std::optional<double> until =
        oracle.agrees_refined(exact, got, from, std::min(t_mesh, t_got));
    if (!until) {
      ++(t_mesh < t_got ? tally.missed : tally.false_hits);
      return;
    }
    if (*until >= t_got) break;
    from = *until;
    t_mesh = oracle.first_hit(exact, from);
  }
  ++tally.unstable;
}

Accuracy judge_frame(const MeshOracle &oracle, const FrameParams &frame,
                     std::span<const HitRecord> hits) {
  return judge_rays(frame, hits, [&](const Ray &ray, const HitRecord &hit, Accuracy &tally) {
    judge(oracle, frame, ray, hit, tally);
  });
}

}  // namespace isowave::core
