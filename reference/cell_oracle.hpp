#pragma once
// The oracle of the traversal: Embree walks the ray through the dual cells, which are primitives of
// their own, and each cell is intersected here in double precision.
//
// Shares no code, constant or formula with the kernels, and none of its maths with the root oracle.
// A primitive is a cell with corners on both sides of the isovalue; its bounds are grown by
// kBoundsMargin, so that Embree's float32 only ever offers too many cells, in any order. The
// closest answer is chosen by t in double precision.
//
// In a cell: voxel_field.hpp.
//
// Unlike the root oracle it is not certified: where the field touches the isovalue to within
// rounding (about 1e-15 of the corners' size), either answer may come. accuracy.hpp counts such
// rays as unstable.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "reference/voxel_field.hpp"

namespace isowave::core {

class EmbreeScene;

class CellOracle final : public HitOracle {
 public:
  /// voxels [nz][ny][nx], x fastest, finite; they must outlive the oracle. dims 2 to 2^16. Builds
  /// Embree's tree.
  ///
  /// Throws  std::invalid_argument: dims; Error: memory
  CellOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims, float isovalue);
  CellOracle(std::span<const double> voxels, std::array<std::uint32_t, 3> dims, float isovalue);
  ~CellOracle() override;
  CellOracle(const CellOracle &) = delete;  // Embree holds its address
  CellOracle &operator=(const CellOracle &) = delete;

  /// Throws  std::invalid_argument for an origin out of Embree's reach (embree_reach.hpp): cells
  ///         could be lost
  OracleHit first_hit(const OracleRay &ray) const override;
  double field(const std::array<double, 3> &point) const override { return field_.field(point); }
  std::array<double, 3> gradient(const std::array<double, 3> &point) const override {
    return field_.gradient(point);
  }

  /// Cells with corners on both sides of the isovalue.
  std::uint64_t num_cells() const { return cells_.size(); }

 private:
  friend struct CellQuery;
  using Cell = VoxelField::Cell;

  CellOracle(std::span<const float> voxels, std::span<const double> exact_voxels,
             std::array<std::uint32_t, 3> dims, float isovalue);
  Cell cell_of(std::uint64_t voxel) const;
  void find_cells();

  VoxelField field_;
  std::vector<std::uint64_t>
      cells_;  ///< by primitive: index of the voxel that is the cell's lower corner
  std::unique_ptr<EmbreeScene> scene_;
};

}  // namespace isowave::core
