#include "reference/cell_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "reference/embree_reach.hpp"
#include "reference/embree_scene.hpp"

namespace isowave::core {

namespace {

using Vec = std::array<double, 3>;
using Cell = std::array<int, 3>;
using Corners = std::array<double, 8>;  ///< minus the isovalue; corner x + 2y + 4z

constexpr int kNoAxis = 3;

/// The part of a ray within a closed box of voxel planes. At its ends the coordinate across the
/// plane is that plane, exactly.
struct Segment {
  double t_enter = 0, t_exit = kInfinity;
  int enter_axis = kNoAxis, exit_axis = kNoAxis;  ///< kNoAxis: the ray starts in the box
  int enter_plane = 0, exit_plane = 0;
};

std::optional<Segment> clip(const OracleRay &ray, const Cell &lower, const Cell &upper) {
  Segment segment;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double o = ray.origin[axis], d = ray.direction[axis];
    if (d == 0) {
      if (o < lower[axis] || o > upper[axis]) return std::nullopt;
      continue;
    }
    const int near = d > 0 ? lower[axis] : upper[axis], far = d > 0 ? upper[axis] : lower[axis];
    const double t_near = (near - o) / d, t_far = (far - o) / d;
    if (t_near > segment.t_enter) {
      segment.t_enter = t_near;
      segment.enter_axis = static_cast<int>(axis);
      segment.enter_plane = near;
    }
    if (t_far < segment.t_exit) {
      segment.t_exit = t_far;
      segment.exit_axis = static_cast<int>(axis);
      segment.exit_plane = far;
    }
  }
  if (segment.t_exit >= segment.t_enter) return segment;
  // A cell touched at an edge may seem missed by a rounding error; what it holds there must still
  // count.
  if (segment.t_exit < segment.t_enter * (1 - 0x1p-49)) return std::nullopt;
  segment.t_exit = segment.t_enter;
  return segment;
}

/// Position in the cell, [0,1]^3, at t of the segment.
Vec local_position(const OracleRay &ray, const Cell &cell, const Segment &segment, double t) {
  Vec p;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int a = static_cast<int>(axis);
    double x = (ray.origin[axis] - cell[axis]) + t * ray.direction[axis];
    if (t == segment.t_enter && a == segment.enter_axis) x = segment.enter_plane - cell[axis];
    if (t == segment.t_exit && a == segment.exit_axis) x = segment.exit_plane - cell[axis];
    p[axis] = std::clamp(x, 0.0, 1.0);
  }
  return p;
}

/// The trilinear field: convex combinations along x, y, z. If all corners have one sign, the field
/// has that sign. At p = 0 or 1 it does not depend on the other side's corners.
double trilinear(Corners v, const Vec &p) {
  unsigned count = 4;
  for (std::size_t axis = 0; axis < 3; ++axis, count /= 2) {
    for (unsigned i = 0; i < count; ++i) v[i] = (1 - p[axis]) * v[2 * i] + p[axis] * v[2 * i + 1];
  }
  return v[0];
}

/// c0 + c1 s + c2 s^2 + c3 s^3: the field from p (s = 0) to q (s = 1), by the same combinations,
/// with factors linear in s.
std::array<double, 4> power_form(const Corners &v, const Vec &p, const Vec &q) {
  std::array<std::array<double, 4>, 8> c{};
  for (unsigned i = 0; i < 8; ++i) c[i][0] = v[i];
  unsigned count = 4;
  for (std::size_t axis = 0; axis < 3; ++axis, count /= 2) {
    const double step = q[axis] - p[axis];
    for (unsigned i = 0; i < count; ++i) {
      std::array<double, 4> sum{};
      for (unsigned power = 0; power <= axis; ++power) {
        const double low = c[2 * i][power], difference = c[2 * i + 1][power] - low;
        sum[power] += low + p[axis] * difference;
        sum[power + 1] += step * difference;
      }
      c[i] = sum;
    }
  }
  return c[0];
}

/// The places in (0,1) where the derivative is 0, ascending; -1 for none.
std::array<double, 2> extrema(const std::array<double, 4> &c) {
  const double a = 3 * c[3], half_b = c[2], constant = c[1];
  const double discriminant = half_b * half_b - a * constant;
  if (!(discriminant >= 0)) return {-1, -1};
  const double q = -(half_b + std::copysign(std::sqrt(discriminant), half_b));  // no cancellation
  const auto in_range = [](double s) {
    return s > 0 && s < 1 ? s : -1.0;
  };  // NaN and infinity are none
  std::array<double, 2> roots{in_range(q / a), in_range(constant / q)};
  if (roots[0] > roots[1]) std::swap(roots[0], roots[1]);
  return roots;
}

/// The first t of the segment at which the field is not on the side `start_inside`.
std::optional<double> first_other_side(const Corners &v, const OracleRay &ray, const Cell &cell,
                                       const Segment &segment, bool start_inside) {
  const auto is_other = [&](double t) {
    return (trilinear(v, local_position(ray, cell, segment, t)) >= 0) != start_inside;
  };
  if (is_other(segment.t_enter)) return segment.t_enter;
  const auto c = power_form(v, local_position(ray, cell, segment, segment.t_enter),
                            local_position(ray, cell, segment, segment.t_exit));
  const double length = segment.t_exit - segment.t_enter;
  const auto [first, second] = extrema(c);
  double low = segment.t_enter;
  for (const double s : {first, second, 1.0}) {
    if (s < 0) continue;
    double high = s < 1 ? segment.t_enter + s * length : segment.t_exit;
    if (!is_other(high)) {
      low = high;
      continue;
    }
    for (;;) {  // until no double lies between
      const double middle = low + 0.5 * (high - low);
      if (middle <= low || middle >= high) return high;
      (is_other(middle) ? high : low) = middle;
    }
  }
  return std::nullopt;
}

/// A float32 not below x.
float round_up(double x) {
  const auto rounded = static_cast<float>(x);
  return rounded < x ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
}

}  // namespace

/// The data that a ray carries through Embree: the exact ray and the best hit so far. Embree's own
/// ray is a float32 copy.
struct CellQuery : RTCIntersectContext {
  const CellOracle *oracle = nullptr;
  const OracleRay *ray = nullptr;
  bool start_inside = false;
  OracleHit best;

  static void bounds(const RTCBoundsFunctionArguments *args) {
    const auto &oracle = *static_cast<const CellOracle *>(args->geometryUserPtr);
    const Cell cell = oracle.cell_of(oracle.cells_[args->primID]);
    const auto margin = static_cast<float>(kBoundsMargin);
    RTCBounds &box = *args->bounds_o;
    box.lower_x = static_cast<float>(cell[0]) - margin;
    box.lower_y = static_cast<float>(cell[1]) - margin;
    box.lower_z = static_cast<float>(cell[2]) - margin;
    box.upper_x = static_cast<float>(cell[0] + 1) + margin;
    box.upper_y = static_cast<float>(cell[1] + 1) + margin;
    box.upper_z = static_cast<float>(cell[2] + 1) + margin;
  }

  static void intersect(const RTCIntersectFunctionNArguments *args) {
    if (args->valid[0] == 0) return;
    auto &query = *static_cast<CellQuery *>(args->context);
    const CellOracle &oracle = *query.oracle;
    const Cell cell = oracle.cell_of(oracle.cells_[args->primID]);
    const auto segment = clip(*query.ray, cell, {cell[0] + 1, cell[1] + 1, cell[2] + 1});
    if (!segment || (query.best.hit && segment->t_enter > query.best.t)) return;
    const auto t =
        first_other_side(oracle.corners(cell), *query.ray, cell, *segment, query.start_inside);
    // If cells have the same t, the lowest cell answers, in any order of Embree's.
    if (!t ||
        (query.best.hit && (*t > query.best.t || (*t == query.best.t && cell > query.best.cell))))
      return;
    query.best = {true, *t, cell};
    // Embree culls boxes beyond tfar. A closer cell's enlarged box begins before its exact t_enter,
    // also as computed (see kEmbreeReach), so a float32 not below t culls none.
    RTCRayN_tfar(RTCRayHitN_RayN(args->rayhit, args->N), args->N, 0) = round_up(*t);
    RTCHitN_geomID(RTCRayHitN_HitN(args->rayhit, args->N), args->N, 0) = args->geomID;
    RTCHitN_primID(RTCRayHitN_HitN(args->rayhit, args->N), args->N, 0) = args->primID;
  }
};

CellOracle::CellOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims,
                       float isovalue)
    : CellOracle(voxels, {}, dims, isovalue) {}
CellOracle::CellOracle(std::span<const double> voxels, std::array<std::uint32_t, 3> dims,
                       float isovalue)
    : CellOracle({}, voxels, dims, isovalue) {}

CellOracle::CellOracle(std::span<const float> voxels, std::span<const double> exact_voxels,
                       std::array<std::uint32_t, 3> dims, float isovalue)
    : voxels_(voxels),
      exact_voxels_(exact_voxels),
      dims_(dims),
      isovalue_(isovalue),
      scene_(std::make_unique<EmbreeScene>(false)) {
  const auto [smallest, largest] = std::minmax_element(dims.begin(), dims.end());
  if (voxels.size() + exact_voxels.size() != std::size_t{dims[0]} * dims[1] * dims[2] ||
      *smallest < 2 || *largest > 0x10000) {
    throw std::invalid_argument(
        "CellOracle: the voxels do not fit the dims, or those are not 2 to 65536");
  }
  find_cells();
  RTCGeometry geometry = rtcNewGeometry(scene_->device(), RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(cells_.size()));
  rtcSetGeometryUserData(geometry, this);
  rtcSetGeometryBoundsFunction(geometry, &CellQuery::bounds, nullptr);
  rtcSetGeometryIntersectFunction(geometry, &CellQuery::intersect);
  scene_->build(geometry);
}

CellOracle::~CellOracle() = default;

void CellOracle::find_cells() {
  const std::size_t row = dims_[0], layer = row * dims_[1];
  const std::array<std::size_t, 8> offsets{0,     1,         row,         row + 1,
                                           layer, layer + 1, layer + row, layer + row + 1};
  for (std::size_t z = 0; z + 1 < dims_[2]; ++z) {
    for (std::size_t y = 0; y + 1 < dims_[1]; ++y) {
      for (std::size_t x = 0; x + 1 < dims_[0]; ++x) {
        const std::size_t first = x + row * y + layer * z;
        int num_inside = 0;
        for (const std::size_t offset : offsets) num_inside += value(first + offset) >= isovalue_;
        if (num_inside != 0 && num_inside != 8) cells_.push_back(first);
      }
    }
  }
  if (cells_.size() >= std::numeric_limits<std::uint32_t>::max()) {
    throw std::invalid_argument("CellOracle: more cells than Embree can number");
  }
}

CellOracle::Cell CellOracle::cell_of(std::uint64_t voxel) const {
  return {static_cast<int>(voxel % dims_[0]), static_cast<int>(voxel / dims_[0] % dims_[1]),
          static_cast<int>(voxel / dims_[0] / dims_[1])};
}

CellOracle::Cell CellOracle::cell_at(const std::array<double, 3> &point) const {
  Cell cell;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double last = dims_[axis] - 2.0;
    cell[axis] = static_cast<int>(std::clamp(std::floor(point[axis]), 0.0, last));
  }
  return cell;
}

std::array<double, 8> CellOracle::corners(const Cell &cell) const {
  Corners v;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const std::size_t x = static_cast<std::size_t>(cell[0]) + (corner & 1u),
                      y = static_cast<std::size_t>(cell[1]) + (corner >> 1 & 1u),
                      z = static_cast<std::size_t>(cell[2]) + (corner >> 2);
    v[corner] =
        value(x + dims_[0] * (y + std::size_t{dims_[1]} * z)) - isovalue_;  // its sign is exact
  }
  return v;
}

/// The side of the ray's first point in the domain. enters: whether there is one, with some of the
/// domain behind it.
bool CellOracle::starts_inside(const OracleRay &ray, bool &enters) const {
  Cell upper;
  for (std::size_t axis = 0; axis < 3; ++axis) upper[axis] = static_cast<int>(dims_[axis]) - 1;
  const auto domain = clip(ray, {0, 0, 0}, upper);
  enters = domain && domain->t_exit > domain->t_enter;
  if (!enters) return false;
  Vec point;
  for (std::size_t axis = 0; axis < 3; ++axis)
    point[axis] = ray.origin[axis] + domain->t_enter * ray.direction[axis];
  const Cell cell = cell_at(point);
  return trilinear(corners(cell), local_position(ray, cell, *domain, domain->t_enter)) >= 0;
}

OracleHit CellOracle::first_hit(const OracleRay &ray) const {
  if (!within_embree_reach(ray.origin, dims_)) {
    throw std::invalid_argument("CellOracle: " + out_of_reach(ray.origin, dims_));
  }
  CellQuery query;
  rtcInitIntersectContext(&query);
  query.oracle = this;
  query.ray = &ray;
  bool enters = false;
  query.start_inside = starts_inside(ray, enters);
  if (!enters) return {};
  RTCRayHit embree = to_embree(ray);
  rtcIntersect1(scene_->scene(), &query, &embree);
  return query.best;
}

double CellOracle::field(const std::array<double, 3> &point) const {
  const Cell cell = cell_at(point);
  Corners v = corners(cell);
  return trilinear(v, {point[0] - cell[0], point[1] - cell[1], point[2] - cell[2]}) + isovalue_;
}

std::array<double, 3> CellOracle::gradient(const std::array<double, 3> &point) const {
  const Cell cell = cell_at(point);
  const Corners v = corners(cell);
  Vec result;
  for (std::size_t axis = 0; axis < 3;
       ++axis) {  // linear along each axis: the difference of two faces
    Vec high{point[0] - cell[0], point[1] - cell[1], point[2] - cell[2]}, low = high;
    high[axis] = 1;
    low[axis] = 0;
    result[axis] = trilinear(v, high) - trilinear(v, low);
  }
  return result;
}

}  // namespace isowave::core
