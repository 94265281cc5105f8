#pragma once
// The trilinear field along a ray in one cell: a cubic, and the first change of `inside`. For host
// and device.

#include <cmath>

#ifdef __CUDACC__
#define PEER_BOTH __host__ __device__ inline
#else
#define PEER_BOTH inline
#endif

namespace isowave::core::bench {

/// Values at a cell's corners minus the isovalue, [4 x + 2 y + z].
struct Corners {
  float f[8];
};

/// Whether some corners are inside, and some not.
PEER_BOTH bool changes(const Corners &cell) {
  int inside = 0;
  for (int i = 0; i < 8; ++i) inside += cell.f[i] >= 0.0f;
  return inside != 0 && inside != 8;
}

/// A ray's way through a cell, [0,1]^3: from + s (to - from), s in [0,1].
struct Segment {
  float from[3], step[3];
};

struct FieldCubic {
  float c[4];  ///< c[0] + c[1] s + c[2] s^2 + c[3] s^3

  PEER_BOTH float at(float s) const { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }
  PEER_BOTH float slope(float s) const { return c[1] + s * (2 * c[2] + s * 3 * c[3]); }
};

/// Interpolates along z, then y, then x, with polynomials of s.
PEER_BOTH FieldCubic cubic_along(const Corners &cell, const Segment &way) {
  float face[2][3];
  for (int x = 0; x < 2; ++x) {
    const float *f = cell.f + 4 * x;
    const float low_slope = f[1] - f[0], high_slope = f[3] - f[2];
    const float low0 = f[0] + low_slope * way.from[2], low1 = low_slope * way.step[2];
    const float diff0 = f[2] + high_slope * way.from[2] - low0;
    const float diff1 = high_slope * way.step[2] - low1;
    face[x][0] = low0 + diff0 * way.from[1];
    face[x][1] = low1 + diff1 * way.from[1] + diff0 * way.step[1];
    face[x][2] = diff1 * way.step[1];
  }
  const float d0 = face[1][0] - face[0][0], d1 = face[1][1] - face[0][1],
              d2 = face[1][2] - face[0][2];
  FieldCubic cubic;
  cubic.c[0] = face[0][0] + d0 * way.from[0];
  cubic.c[1] = face[0][1] + d1 * way.from[0] + d0 * way.step[0];
  cubic.c[2] = face[0][2] + d2 * way.from[0] + d1 * way.step[0];
  cubic.c[3] = d2 * way.step[0];
  return cubic;
}

/// The gradient of the cell's field at a place in it.
PEER_BOTH void gradient_at(const Corners &cell, const float at[3], float gradient[3]) {
  const float *f = cell.f;
  const float x = at[0], y = at[1], z = at[2];
  const float e00 = f[0] + (f[1] - f[0]) * z, e01 = f[2] + (f[3] - f[2]) * z;
  const float e10 = f[4] + (f[5] - f[4]) * z, e11 = f[6] + (f[7] - f[6]) * z;
  gradient[0] = (e10 - e00) + ((e11 - e01) - (e10 - e00)) * y;
  gradient[1] = (e01 - e00) + ((e11 - e10) - (e01 - e00)) * x;
  const float low = (f[1] - f[0]) + ((f[5] - f[4]) - (f[1] - f[0])) * x;
  const float high = (f[3] - f[2]) + ((f[7] - f[6]) - (f[3] - f[2])) * x;
  gradient[2] = low + (high - low) * y;
}

/// The places in (0,1) at which the cubic may turn, in order; 1: there is none.
struct Turns {
  float first = 1.0f, second = 1.0f;
};

PEER_BOTH Turns turning_points(const FieldCubic &cubic) {
  Turns turns;
  const float a = 3 * cubic.c[3], half_b = cubic.c[2], c = cubic.c[1];
  const float d = half_b * half_b - a * c;
  if (!(d > 0.0f)) return turns;
  const float q = -(half_b + copysignf(sqrtf(d), half_b));
  const float one = q / a, other = c / q;  // not finite if a = 0: in no comparison
  const float low = fminf(one, other), high = fmaxf(one, other);
  const bool has_low = low > 0.0f && low<1.0f, has_high = high> 0.0f && high < 1.0f;
  turns.first = has_low ? low : (has_high ? high : 1.0f);
  turns.second = has_low && has_high ? high : 1.0f;
  return turns;
}

/// The root between two places on different sides: Newton's steps, halves where they leave.
///
/// inside  side of `low`
PEER_BOTH float root_between(const FieldCubic &cubic, bool inside, float low, float high) {
  const float at_low = cubic.at(low), at_high = cubic.at(high);
  float s = low + (high - low) * (at_low / (at_low - at_high));
  if (!(s > low && s < high)) s = 0.5f * (low + high);
  for (int i = 0; i < 16; ++i) {
    const float value = cubic.at(s);
    if ((value >= 0.0f) == inside) {
      low = s;
    } else {
      high = s;
    }
    float next = s - value / cubic.slope(s);
    if (!(next > low && next < high)) next = 0.5f * (low + high);
    const float moved = fabsf(next - s);
    s = next;
    if (moved < 1e-7f) break;
  }
  return s;
}

/// The first s in [0,1] whose side is not `inside`. Returns whether there is one.
PEER_BOTH bool first_change(const FieldCubic &cubic, bool inside, float *s) {
  *s = 0.0f;
  if ((cubic.c[0] >= 0.0f) != inside) return true;
  const Turns turns = turning_points(cubic);
  float low = 0.0f, high = turns.first;
  for (int i = 0; i < 3; ++i) {
    if ((cubic.at(high) >= 0.0f) != inside) {
      *s = root_between(cubic, inside, low, high);
      return true;
    }
    if (high == 1.0f) return false;
    low = high;
    high = i == 0 ? turns.second : 1.0f;
  }
  return false;
}

}  // namespace isowave::core::bench
