#pragma once
// The trilinear field of voxels in double precision, and its crossings of the isovalue along a ray
// within a cell: what the oracles that look at cells share. No code, constant or formula comes from
// the kernels.
//
// In a cell: the field along the ray's segment is a cubic in power form; its extrema (quadratic
// formula without cancellation) cut the segment into monotone pieces; the first piece that ends on
// the other side is bisected. Sides are judged by the field itself, a convex combination of the
// corners, which has the same value in both cells at a shared face, and whose sign is right
// wherever all corners have one sign. What is looked for in each cell is the first point on the
// other side than the ray's start; so a change that rounding puts between two cells is found at the
// entry of the second.

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "reference/hit_oracle.hpp"

namespace isowave::core {

inline constexpr int kNoAxis = 3;

/// The part of a ray within a closed box of voxel planes. At its ends the coordinate across the
/// plane is that plane, exactly.
struct OracleSegment {
  double t_enter = 0, t_exit = kInfinity;
  int enter_axis = kNoAxis, exit_axis = kNoAxis;  ///< kNoAxis: the ray starts in the box
  int enter_plane = 0, exit_plane = 0;
};

/// None: the ray misses the box.
std::optional<OracleSegment> clip(const OracleRay &ray, const std::array<int, 3> &lower,
                                  const std::array<int, 3> &upper);

/// The voxels of a volume, and the field between them.
class VoxelField {
 public:
  using Cell = std::array<int, 3>;
  using Point = std::array<double, 3>;
  using Corners = std::array<double, 8>;  ///< minus the isovalue; corner x + 2y + 4z

  /// voxels, exact_voxels  [nz][ny][nx], x fastest, finite: one of the two, the other is empty;
  ///                       they must outlive the field
  /// dims                  2 to 2^16
  /// Throws  std::invalid_argument: voxels and dims do not fit, or dims are out of range
  VoxelField(std::span<const float> voxels, std::span<const double> exact_voxels,
             std::array<std::uint32_t, 3> dims, float isovalue);

  const std::array<std::uint32_t, 3> &dims() const { return dims_; }
  double isovalue() const { return isovalue_; }
  double value(std::size_t voxel) const {
    return exact_voxels_.empty() ? double{voxels_[voxel]} : exact_voxels_[voxel];
  }
  std::size_t voxel_at(int x, int y, int z) const {
    return static_cast<std::size_t>(x) +
           dims_[0] * (static_cast<std::size_t>(y) + std::size_t{dims_[1]} * std::size_t(z));
  }
  /// The cell of the domain that is nearest to a point.
  Cell cell_at(const Point &point) const;
  Corners corners(const Cell &cell) const;

  /// The side of the ray's first point in the domain. enters: whether there is one, with some of
  /// the domain behind it.
  bool starts_inside(const OracleRay &ray, bool &enters) const;
  /// The first t in a cell at which the field is not on the side `start_inside`.
  std::optional<double> first_other_side(const OracleRay &ray, const Cell &cell,
                                         const OracleSegment &segment, bool start_inside) const;

  /// The field and its gradient, as HitOracle has them.
  double field(const Point &point) const;
  Point gradient(const Point &point) const;
  /// Central differences at the eight voxels of the point's cell, one-sided at the domain's border,
  /// trilinear between them. If all are 0, gradient().
  Point smooth_gradient(const Point &point, const Cell &cell) const;

 private:
  std::span<const float> voxels_;         ///< or
  std::span<const double> exact_voxels_;  ///< these
  std::array<std::uint32_t, 3> dims_;
  double isovalue_;
};

}  // namespace isowave::core
