#pragma once
// The oracle of the intersection: where a ray first changes sides of the isosurface of the
// trilinear field, decided exactly.
//
// Shares no code, constant or formula with the kernels. Rays and voxels are float32, hence rational
// numbers; the field along a ray is a piecewise cubic with rational coefficients. Double-precision
// interval arithmetic answers nearly every question; what it leaves open is decided in exact
// rational arithmetic (GMP), so every answer is certified.

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "reference/hit_oracle.hpp"

namespace isowave::core {

/// Where a ray changes sides.
struct OracleChange {
  double t = 0;               ///< as OracleHit::t
  std::array<int, 3> cell{};  ///< dual cell in whose closed segment it lies
  bool enters = false;        ///< inside is behind it
  /// Between the change before, or the ray's beginning, and this one, the ray passes a cell without
  /// data.
  bool behind_gap = false;
};

class RootOracle final : public HitOracle {
 public:
  /// voxels [nz][ny][nx], x fastest, finite or NaN: without data; they must outlive the oracle. A
  /// cell with a corner without data has no hit. dims >= 2.
  RootOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims, float isovalue);

  OracleHit first_hit(const OracleRay &ray) const override { return first_hit(ray, 0); }
  /// The same of the part of the ray from t = begin on, begin >= 0.
  OracleHit first_hit(const OracleRay &ray, double begin) const;
  /// All changes of sides of that part, in their order, or the first `most` of them. A point at
  /// which the ray touches the surface from outside is two: the ray enters and leaves there.
  /// Between cells on both sides of a gap without data there is none.
  std::vector<OracleChange> changes(
      const OracleRay &ray, double begin,
      std::size_t most = std::numeric_limits<std::size_t>::max()) const;
  /// The t at which parts of the ray with data begin and end: where it enters and leaves the
  /// domain, and cells without data.
  std::vector<double> borders(const OracleRay &ray) const;
  /// Whether the ray's point at t is inside, decided exactly. None: its cell lacks data. A point
  /// beside the domain counts as the domain's nearest one.
  std::optional<bool> inside(const OracleRay &ray, double t) const;
  double field(const std::array<double, 3> &point) const override;
  std::array<double, 3> gradient(const std::array<double, 3> &point) const override;

  /// How many cells needed exact arithmetic so far.
  std::uint64_t num_exact_cells() const { return num_exact_cells_; }

 private:
  std::array<double, 8> corners(const std::array<int, 3> &cell) const;

  std::span<const float> voxels_;
  std::array<std::uint32_t, 3> dims_;
  double isovalue_;
  mutable std::atomic<std::uint64_t> num_exact_cells_{0};
};

/// The first s in [0,1] at which a cubic in Bernstein form changes sides of 0 (half-open: 0 is
/// inside), none if it never does. Exact, placed to double precision.
std::optional<double> first_change_of_cubic(const std::array<double, 4> &coefficients);

}  // namespace isowave::core
