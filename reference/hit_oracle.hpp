#pragma once
// The interface of the oracles of the trilinear field: given a ray, its first hit; given a point,
// the field. Each oracle answers with its own maths. Nothing here, nor in any oracle, comes from
// the kernels.

#include <array>
#include <limits>

namespace isowave::core {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A ray in index space: position = origin + t direction, t >= 0. The numbers are taken as exact;
/// the renderer's float32 ones fit without rounding.
struct OracleRay {
  std::array<double, 3> origin{}, direction{};
};

struct OracleHit {
  bool hit = false;
  double t = 0;               ///< of the first change of inside, relative error about 1e-15
  std::array<int, 3> cell{};  ///< dual cell in whose closed segment it lies
};

class HitOracle {
 public:
  virtual ~HitOracle() = default;

  /// The first t at which (field >= isovalue) differs from its value where the ray enters the
  /// domain [0, dims-1], or starts in it. Thread-safe.
  virtual OracleHit first_hit(const OracleRay &ray) const = 0;

  /// The field at a point of the domain in double precision, and its gradient.
  virtual double field(const std::array<double, 3> &point) const = 0;
  virtual std::array<double, 3> gradient(const std::array<double, 3> &point) const = 0;
};

}  // namespace isowave::core
