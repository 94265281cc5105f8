/// solve_bernstein.h -- sign variations of Bernstein coefficients reject and isolate, bracketed Newton refines [Yuksel 2022].
///
/// Guarantees: a change of inside between entry and exit is always found; a pair of crossings is found down to the
/// rounding of the coefficients, because the value at an extremum depends on its place only to second order. Nothing is
/// divided by a leading coefficient. The result lies in a bracket whose ends differ in inside.
/// Fails: crossings that rounding of the coefficients itself removes or adds (about 2^-23 of the largest corner).
#ifndef ISOWAVE_SOLVE_BERNSTEIN_H
#define ISOWAVE_SOLVE_BERNSTEIN_H

#include "cubic.h"

ISO_NAMESPACE_BEGIN

/// The iteration ends when s moves less than this: 2^-23 of the way through the cell.
#define ISO_ROOT_STEP 0x1p-23f

/// s = n / (n + m) where n and m have one sign, so nothing cancels; -1 where they do not.
static inline float same_sign_fraction(float n, float m) {
  return (n > 0.0f && m > 0.0f) || (n < 0.0f && m < 0.0f) ? n / (n + m) : -1.0f;
}

/// The first s at which `inside` differs from its value at s = 0. Returns 0 if it never does.
///
/// No sign variation in the coefficients: no change (the curve lies in their hull). One: exactly one root,
/// bracketed by [0,1]. More: [0,1] is split where the derivative d0 (1-s)^2 + 2 d1 s (1-s) + d2 s^2 is 0.
/// With r = s / (1-s) > 0 that is d2 r^2 + 2 d1 r + d0 = 0, whose roots q / d2 and d0 / q (q = -(d1 +-
/// sqrt(d1^2 - d0 d2)), larger magnitude) give s without cancellation and without dividing by a leading
/// coefficient. A tangent's extremum is found to rounding because the value there depends on s only to second
/// order.
static inline int solve_bernstein(Cubic c, int max_steps, float *s_hit) {
  const int in0 = c.b0 >= 0.0f, in1 = c.b1 >= 0.0f, in2 = c.b2 >= 0.0f, in3 = c.b3 >= 0.0f;
  float lo = 0.0f, hi = 1.0f, s, value, derivative;
  int found = in0 != in3;
  int step;
  if (in0 == in1 && in0 == in2 && in0 == in3) return 0;
  if (in0 == in3 || (in1 != in0 && in2 == in0)) {
    const float e0 = c.b1 - c.b0, e1 = c.b2 - c.b1, e2 = c.b3 - c.b2;
    const float e01 = fabs(e0) > fabs(e1) ? fabs(e0) : fabs(e1), largest = fabs(e2) > e01 ? fabs(e2) : e01;
    /* Squares of huge or tiny values would not survive; only the ratios of the three count. */
    const float d0 = e0 / largest, d1 = e1 / largest, d2 = e2 / largest;
    const float d02 = d0 * d2;
    const float discriminant = fma(d1, d1, -d02) + fma(-d0, d2, d02); /* Kahan: exact to an ulp or two */
    if (discriminant > 0.0f) {
      const float root = sqrt(discriminant);
      const float q = d1 > 0.0f ? -(d1 + root) : root - d1;
      const float s_a = same_sign_fraction(q, d2), s_b = same_sign_fraction(d0, q);
      const float s_first = s_a < s_b ? s_a : s_b, s_second = s_a < s_b ? s_b : s_a;
      if (s_first >= 0.0f) {
        if (cubic_inside(c, s_first) != in0) {
          hi = s_first;
          found = 1;
        } else {
          lo = s_first;
        }
      }
      if (hi == 1.0f && s_second >= 0.0f) {
        if (cubic_inside(c, s_second) != in0) {
          hi = s_second;
          found = 1;
        } else {
          lo = s_second;
        }
      }
    }
  }
  if (!found) return 0;
  /* inside changes between lo and hi: Newton, kept in the bracket by bisection. */
  s = 0.5f * (lo + hi);
  if (lo == 0.0f && hi == 1.0f) s = c.b0 / (c.b0 - c.b3); /* signs differ: the chord's root, in [0,1] */
  for (step = 0; step < max_steps; ++step) {
    float next;
    value = cubic_value(c, s, &derivative);
    if ((value >= 0.0f) == in0) {
      lo = s;
    } else {
      hi = s;
    }
    next = s - value / derivative;
    if (!(next > lo && next < hi)) next = 0.5f * (lo + hi); /* also when derivative = 0 */
    if (fabs(next - s) < ISO_ROOT_STEP) {
      s = next;
      break;
    }
    s = next;
  }
  *s_hit = s;
  return 1;
}

ISO_NAMESPACE_END

#endif
