#include "reference/voxel_field.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace isowave::core {

namespace {

using Vec = VoxelField::Point;
using Cell = VoxelField::Cell;
using Corners = VoxelField::Corners;

/// Position in the cell, [0,1]^3, at t of the segment.
Vec local_position(const OracleRay &ray, const Cell &cell, const OracleSegment &segment, double t) {
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

}  // namespace

std::optional<OracleSegment> clip(const OracleRay &ray, const Cell &lower, const Cell &upper) {
  OracleSegment segment;
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

VoxelField::VoxelField(std::span<const float> voxels, std::span<const double> exact_voxels,
                       std::array<std::uint32_t, 3> dims, float isovalue)
    : voxels_(voxels), exact_voxels_(exact_voxels), dims_(dims), isovalue_(isovalue) {
  const auto [smallest, largest] = std::minmax_element(dims.begin(), dims.end());
  if (voxels.size() + exact_voxels.size() != std::size_t{dims[0]} * dims[1] * dims[2] ||
      *smallest < 2 || *largest > 0x10000) {
    throw std::invalid_argument(
        "VoxelField: the voxels do not fit the dims, or those are not 2 to 65536");
  }
}

VoxelField::Cell VoxelField::cell_at(const Point &point) const {
  Cell cell;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double last = dims_[axis] - 2.0;
    cell[axis] = static_cast<int>(std::clamp(std::floor(point[axis]), 0.0, last));
  }
  return cell;
}

VoxelField::Corners VoxelField::corners(const Cell &cell) const {
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

bool VoxelField::starts_inside(const OracleRay &ray, bool &enters) const {
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

std::optional<double> VoxelField::first_other_side(const OracleRay &ray, const Cell &cell,
                                                   const OracleSegment &segment,
                                                   bool start_inside) const {
  const Corners v = corners(cell);
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

double VoxelField::field(const Point &point) const {
  const Cell cell = cell_at(point);
  Corners v = corners(cell);
  return trilinear(v, {point[0] - cell[0], point[1] - cell[1], point[2] - cell[2]}) + isovalue_;
}

VoxelField::Point VoxelField::gradient(const Point &point) const {
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

VoxelField::Point VoxelField::smooth_gradient(const Point &point, const Cell &cell) const {
  std::array<Corners, 3> differences{};
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Cell voxel{cell[0] + int(corner & 1u), cell[1] + int(corner >> 1 & 1u),
                     cell[2] + int(corner >> 2)};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Cell before = voxel, behind = voxel;
      before[axis] = std::max(voxel[axis] - 1, 0);
      behind[axis] = std::min(voxel[axis] + 1, static_cast<int>(dims_[axis]) - 1);
      differences[axis][corner] = (value(voxel_at(behind[0], behind[1], behind[2])) -
                                   value(voxel_at(before[0], before[1], before[2]))) /
                                  (behind[axis] - before[axis]);
    }
  }
  Point place, result;
  for (std::size_t axis = 0; axis < 3; ++axis)
    place[axis] = std::clamp(point[axis] - cell[axis], 0.0, 1.0);
  for (std::size_t axis = 0; axis < 3; ++axis) result[axis] = trilinear(differences[axis], place);
  return result == Point{} ? gradient(point) : result;
}

}  // namespace isowave::core
