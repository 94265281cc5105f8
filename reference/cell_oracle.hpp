#pragma once
// The oracle of the traversal: Embree walks the ray through the dual cells, which are primitives of
// their own, and each cell is intersected here in double precision.
//
// Shares no code, constant or formula with the kernels, and none of its maths with the root oracle.
// A primitive is a cell with corners on both sides of the isovalue; its bounds are grown by
// kBoundsMargin, so that Embree's float32 only ever offers too many cells, in any order. The
// closest answer is chosen by t in double precision.
//
// In a cell: the field along the ray's segment is a cubic in power form; its extrema (quadratic
// formula without cancellation) cut the segment into monotone pieces; the first piece that ends on
// the other side is bisected. Sides are judged by the field itself, a convex combination of the
// corners, which has the same value in both cells at a shared face, and whose sign is right
// wherever all corners have one sign. What is looked for in each cell is the first point on the
// other side than the ray's start; so a change that rounding puts between two cells is found at the
// entry of the second.
//
// Unlike the root oracle it is not certified: where the field touches the isovalue to within
// rounding (about 1e-15 of the corners' size), either answer may come. accuracy.hpp counts such
// rays as unstable.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "reference/hit_oracle.hpp"

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
  double field(const std::array<double, 3> &point) const override;
  std::array<double, 3> gradient(const std::array<double, 3> &point) const override;

  /// Cells with corners on both sides of the isovalue.
  std::uint64_t num_cells() const { return cells_.size(); }

 private:
  friend struct CellQuery;
  using Cell = std::array<int, 3>;

  CellOracle(std::span<const float> voxels, std::span<const double> exact_voxels,
             std::array<std::uint32_t, 3> dims, float isovalue);
  double value(std::size_t voxel) const {
    return exact_voxels_.empty() ? double{voxels_[voxel]} : exact_voxels_[voxel];
  }
  Cell cell_of(std::uint64_t voxel) const;
  Cell cell_at(const std::array<double, 3> &point) const;
  std::array<double, 8> corners(const Cell &cell) const;
  void find_cells();
  bool starts_inside(const OracleRay &ray, bool &enters) const;

  std::span<const float> voxels_;         ///< or
  std::span<const double> exact_voxels_;  ///< these
  std::array<std::uint32_t, 3> dims_;
  double isovalue_;
  std::vector<std::uint64_t>
      cells_;  ///< by primitive: index of the voxel that is the cell's lower corner
  std::unique_ptr<EmbreeScene> scene_;
};

}  // namespace isowave::core
