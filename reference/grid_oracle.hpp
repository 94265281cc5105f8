#pragma once
// An oracle for many rays: it walks through bricks of 8^3 cells, and through the cells of those
// bricks that have voxels on both sides of the isovalue, in double precision. It answers as
// CellOracle does (voxel_field.hpp), without a tree, so that pictures of billions of voxels can be
// judged.

#include <cstdint>
#include <span>
#include <vector>

#include "reference/voxel_field.hpp"

namespace isowave::core {

class GridOracle final : public HitOracle {
 public:
  /// Looks at all voxels once, with all threads.
  ///
  /// voxels  [nz][ny][nx], x fastest, finite; they must outlive the oracle
  /// Throws  std::invalid_argument: what VoxelField throws
  GridOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims, float isovalue);

  OracleHit first_hit(const OracleRay &ray) const override;
  double field(const std::array<double, 3> &point) const override { return field_.field(point); }
  std::array<double, 3> gradient(const std::array<double, 3> &point) const override {
    return field_.gradient(point);
  }
  const VoxelField &voxels() const { return field_; }

 private:
  using Cell = VoxelField::Cell;

  std::size_t brick_at(const Cell &brick) const {
    return static_cast<std::size_t>(brick[0]) +
           bricks_[0] * (static_cast<std::size_t>(brick[1]) +
                         bricks_[1] * static_cast<std::size_t>(brick[2]));
  }
  bool has_both_sides(const Cell &lower, const Cell &upper) const;
  OracleHit hit_within(const OracleRay &ray, const Cell &lower, const Cell &upper,
                       bool start_inside) const;

  VoxelField field_;
  std::array<std::size_t, 3> bricks_{};  ///< along each axis
  std::vector<std::uint8_t> active_;     ///< by brick: it has voxels on both sides
};

}  // namespace isowave::core
