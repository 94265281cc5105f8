/// solve_analytic.h -- the closed form of the cubic [Parker et al. 1998; Schwarze 1990].
///
/// Guarantees: none above what cancellation leaves.
/// Fails: it divides by the leading coefficient, which is rounding noise wherever the field is
/// nearly linear or quadratic along the ray - most cells of real data; switching to the quadratic
/// there needs a threshold, and on either side of any threshold digits are lost. Roots near 0 and 1
/// fall out of [0,1] by rounding, so rays slip through cell faces. OpenCL leaves the bits of cbrt,
/// acos and cos open; the ones here are made of add, multiply, divide and sqrt, so that devices and
/// twin agree.
#ifndef ISOWAVE_SOLVE_ANALYTIC_H
#define ISOWAVE_SOLVE_ANALYTIC_H

#include "cubic.h"

ISO_NAMESPACE_BEGIN

/// Below this share of the largest coefficient the leading one counts as 0.
#define ISO_ANALYTIC_DEGENERATE 1e-5f

/// Cube root: halves the exponent's third by a power of two, then Newton. Relative error about
/// 1e-7.
ISO_INLINE float portable_cbrt(float x) {
  union {
    float f;
    uint u;
  } guess;
  const float a = fabs(x);
  int i;
  if (a == 0.0f) return 0.0f;
  guess.f = a;
  guess.u = guess.u / 3u + 0x2A514067u; /* divides the exponent by three; good to 5 % */
  for (i = 0; i < 4; ++i) guess.f = (2.0f * guess.f + a / (guess.f * guess.f)) / 3.0f;
  return x < 0.0f ? -guess.f : guess.f;
}

/// Arc cosine on [-1,1] [Abramowitz and Stegun 4.4.46]: absolute error about 2e-8 before rounding.
ISO_INLINE float portable_acos(float x) {
  const float a = fabs(x) > 1.0f ? 1.0f : fabs(x);
  float p = -0.0012624911f;
  float angle;
  p = fma(p, a, 0.0066700901f);
  p = fma(p, a, -0.0170881256f);
  p = fma(p, a, 0.0308918810f);
  p = fma(p, a, -0.0501743046f);
  p = fma(p, a, 0.0889789874f);
  p = fma(p, a, -0.2145988016f);
  p = fma(p, a, 1.5707963050f);
  angle = p * sqrt(1.0f - a);
  return x < 0.0f ? 3.14159265f - angle : angle;
}

/// Cosine on [-pi/3, pi] by Taylor series about 0 of a half angle: absolute error about 1e-7.
ISO_INLINE float portable_cos(float x) {
  const float h = 0.25f * x, h2 = h * h;
  const float c = fma(
      h2, fma(h2, fma(h2, fma(h2, 1.0f / 40320.0f, -1.0f / 720.0f), 1.0f / 24.0f), -0.5f), 1.0f);
  const float cos_half = fma(2.0f * c, c, -1.0f);
  return fma(2.0f * cos_half, cos_half, -1.0f);
}

/// The bracket is the root itself: the closed form has nothing to refine.
ISO_INLINE int isolate_analytic(Cubic c, Bracket *bracket) {
  const PowerCubic p = power_form(c);
  const float largest_low = fabs(p.p1) > fabs(p.p0) ? fabs(p.p1) : fabs(p.p0);
  const float largest = fabs(p.p2) > largest_low ? fabs(p.p2) : largest_low;
  float roots[3];
  float best = 2.0f;
  int count = 0, i;
  if (fabs(p.p3) > ISO_ANALYTIC_DEGENERATE * largest) {
    /* s = y - a/3 takes s^3 + a s^2 + b s + d to y^3 + 3 m y + 2 n. */
    const float a = p.p2 / p.p3, b = p.p1 / p.p3, d = p.p0 / p.p3;
    const float third = a / 3.0f;
    const float m = (b - a * third) / 3.0f;
    const float n = third * third * third - 0.5f * third * b + 0.5f * d;
    const float discriminant = m * m * m + n * n;
    if (discriminant > 0.0f) {
      const float root = sqrt(discriminant);
      roots[count++] = portable_cbrt(root - n) + portable_cbrt(-n - root) - third;
    } else if (m < 0.0f) {
      const float r = sqrt(-m);
      const float angle = portable_acos(-n / (r * r * r)) / 3.0f;
      roots[count++] = 2.0f * r * portable_cos(angle) - third;
      roots[count++] = -2.0f * r * portable_cos(1.04719755f - angle) - third;
      roots[count++] = -2.0f * r * portable_cos(1.04719755f + angle) - third;
    } else {
      roots[count++] = -third;
    }
  } else if (fabs(p.p2) > ISO_ANALYTIC_DEGENERATE * largest_low) {
    const float discriminant = p.p1 * p.p1 - 4.0f * p.p2 * p.p0;
    if (discriminant >= 0.0f) {
      const float root = sqrt(discriminant);
      roots[count++] = (-p.p1 - root) / (2.0f * p.p2);
      roots[count++] = (-p.p1 + root) / (2.0f * p.p2);
    }
  } else if (p.p1 != 0.0f) {
    roots[count++] = -p.p0 / p.p1;
  }
  for (i = 0; i < count; ++i) {
    if (roots[i] >= 0.0f && roots[i] <= 1.0f && roots[i] < best) best = roots[i];
  }
  bracket->lo = bracket->hi = best;
  return best <= 1.0f;
}

ISO_NAMESPACE_END

#endif
