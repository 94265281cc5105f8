#pragma once
// Sign changes of a cubic by brute force, in long double.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "kernels_cl/portable/cell_intersect.h"

namespace isowave::core {

using Real = long double;
inline constexpr Real kUnit = 0x1p-24L;  ///< largest relative error of one float32 operation

/// c0 + c1 s + c2 s^2 + c3 s^3.
struct Polynomial {
  std::array<Real, 4> c{};
  Real value(Real s) const { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }
  Real slope(Real s) const { return c[1] + s * (2 * c[2] + 3 * s * c[3]); }
};

inline Polynomial power_basis(const Cubic &b) {
  const Real b0 = b.b0, b1 = b.b1, b2 = b.b2, b3 = b.b3;
  return {{b0, 3 * (b1 - b0), 3 * (b0 - 2 * b1 + b2), b3 - b0 + 3 * (b1 - b2)}};
}

/// Brute force: 0, 1, and the extrema between them cut [0,1] into monotone pieces.
struct FirstChange {
  bool found = false;
  Real s = 0;
  Real margin =
      0;  ///< smallest |f| at a cut: if it is below rounding, either side is possible there
};

inline FirstChange first_change_of(const Polynomial &f) {
  std::vector<Real> cuts = {0};
  const Real a = 3 * f.c[3], b = 2 * f.c[2], c = f.c[1];
  std::vector<Real> extrema;
  if (a == 0) {
    if (b != 0) extrema = {-c / b};
  } else if (const Real discriminant = b * b - 4 * a * c; discriminant > 0) {
    const Real q = -(b + std::copysign(std::sqrt(discriminant), b)) / 2;
    extrema = {q / a};
    if (q != 0) extrema.push_back(c / q);
  }
  std::ranges::sort(extrema);
  for (const Real s : extrema) {
    if (s > 0 && s < 1) cuts.push_back(s);
  }
  cuts.push_back(1);

  FirstChange change;
  change.margin = INFINITY;
  for (const Real s : cuts) change.margin = std::min(change.margin, std::abs(f.value(s)));
  const bool inside = f.value(0) >= 0;
  for (std::size_t i = 1; i < cuts.size(); ++i) {
    if ((f.value(cuts[i]) >= 0) == inside) continue;
    Real low = cuts[i - 1], high = cuts[i];
    for (int step = 0; step < 80; ++step) {
      const Real middle = (low + high) / 2;
      ((f.value(middle) >= 0) == inside ? low : high) = middle;
    }
    change.found = true;
    change.s = high;
    return change;
  }
  return change;
}

}  // namespace isowave::core
