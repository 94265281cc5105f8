/// solve_bernstein.h -- sign variations of Bernstein coefficients reject and isolate, bracketed
/// Newton refines [Yuksel 2022]. If float rounding would decide between crossing and passing by,
/// 48-bit arithmetic decides.
///
/// Guarantees: a change of inside between entry and exit is always found. A pair of crossings is
/// found even if it is shallower than the rounding of the float coefficients. Nothing is divided by
/// a leading coefficient. The result lies in a bracket whose ends differ in inside. Fails:
/// crossings that only the rounding of the positions of entry and exit (2^-25 voxels) removes or
/// adds.
#ifndef ISOWAVE_SOLVE_BERNSTEIN_H
#define ISOWAVE_SOLVE_BERNSTEIN_H

#include "cubic.h"

ISO_NAMESPACE_BEGIN

/// The iteration ends when s moves less than this: 2^-23 of the way through the cell.
#define ISO_ROOT_STEP 0x1p-23f
/// Bound on the rounding of a float coefficient and of a value computed from it, in units of the
/// largest coefficient: what is smaller has no certain sign.
#define ISO_CUBIC_NOISE 0x1p-20f

/// An answer besides 0 and 1: the sign of something too small decides. See isolate_precisely().
#define ISO_DOUBTFUL 2

/// s = n / (n + m) if n and m have one sign, so nothing cancels; otherwise -1.
ISO_INLINE float same_sign_fraction(float n, float m) {
  return (n > 0.0f && m > 0.0f) || (n < 0.0f && m < 0.0f) ? n / (n + m) : -1.0f;
}

/// The extrema of a cubic, first <= second; -1 for none.
typedef struct Extrema {
  float first, second;
  float discriminant;  ///< of the derivative, whose largest coefficient is scaled to 1
} Extrema;

/// The derivative is d0 (1-s)^2 + 2 d1 s (1-s) + d2 s^2, up to a factor. With r = s / (1-s) > 0
/// that is d2 r^2 + 2 d1 r + d0 = 0, whose roots q / d2 and d0 / q (q = -(d1 +- sqrt(d1^2 - d0
/// d2)), larger magnitude) give s without cancellation and without dividing by a leading
/// coefficient.
ISO_INLINE Extrema cubic_extrema(float e0, float e1, float e2) {
  const float e01 = fabs(e0) > fabs(e1) ? fabs(e0) : fabs(e1),
              largest = fabs(e2) > e01 ? fabs(e2) : e01;
  /* Squares of huge or tiny values would not survive; only the ratios of the three count. */
  const float d0 = e0 / largest, d1 = e1 / largest, d2 = e2 / largest;
  const float d02 = d0 * d2;
  Extrema at;
  at.first = at.second = -1.0f;
  at.discriminant = fma(d1, d1, -d02) + fma(-d0, d2, d02); /* Kahan: exact to an ulp or two */
  if (at.discriminant > 0.0f) {
    const float root = sqrt(at.discriminant);
    const float q = d1 > 0.0f ? -(d1 + root) : root - d1;
    const float s_a = same_sign_fraction(q, d2), s_b = same_sign_fraction(d0, q);
    at.first = s_a < s_b ? s_a : s_b;
    at.second = s_a < s_b ? s_b : s_a;
  }
  return at;
}

ISO_INLINE float largest_coefficient(Cubic c) {
  const float b01 = fabs(c.b0) > fabs(c.b1) ? fabs(c.b0) : fabs(c.b1);
  const float b23 = fabs(c.b2) > fabs(c.b3) ? fabs(c.b2) : fabs(c.b3);
  return b01 > b23 ? b01 : b23;
}

/// The first piece of [0,1] at whose ends inside differs. Returns 1, 0 if it never does, or
/// ISO_DOUBTFUL.
///
/// No sign variation in the coefficients: no change (the curve lies in their hull). One: exactly
/// one root, bracketed by [0,1]. More: [0,1] is split at the extrema. An extremum's value depends
/// on its place only to second order, so its sign is certain unless the value is noise. If the
/// derivative's discriminant is noise, it is not certain that there is an extremum.
ISO_INLINE int isolate_bernstein(Cubic c, Bracket *bracket) {
  const int in0 = c.b0 >= 0.0f, in1 = c.b1 >= 0.0f, in2 = c.b2 >= 0.0f, in3 = c.b3 >= 0.0f;
  bracket->lo = 0.0f;
  bracket->hi = 1.0f;
  if (in0 == in1 && in0 == in2 && in0 == in3) return 0;
  if (in0 == in3 || (in1 != in0 && in2 == in0)) {
    const Extrema at = cubic_extrema(c.b1 - c.b0, c.b2 - c.b1, c.b3 - c.b2);
    const float noise = ISO_CUBIC_NOISE * largest_coefficient(c);
    int i;
    if (fabs(at.discriminant) <= ISO_CUBIC_NOISE) return ISO_DOUBTFUL;
    for (i = 0; i < 2; ++i) {
      const float s = i == 0 ? at.first : at.second;
      float value, derivative;
      if (s < 0.0f) continue;
      value = cubic_value(c, s, &derivative);
      if (fabs(value) <= noise) return ISO_DOUBTFUL;
      if ((value >= 0.0f) != in0) {
        bracket->hi = s;
        return 1;
      }
      bracket->lo = s;
    }
    return in0 != in3;
  }
  return 1;
}

/// The piece of [0,1] with change number `number` of inside, 0: the first. Returns as
/// isolate_bernstein(), whose answers for number 0 are the same.
///
/// Changes lie in different pieces between 0, the extrema and 1, so a ray that goes on from one of
/// them finds the next, whatever rounding does to their places.
ISO_INLINE int isolate_bernstein_change(Cubic c, uint number, Bracket *bracket) {
  const int in0 = c.b0 >= 0.0f, in1 = c.b1 >= 0.0f, in2 = c.b2 >= 0.0f, in3 = c.b3 >= 0.0f;
  Extrema at;
  float noise;
  int inside = in0, i;
  if (number == 0) return isolate_bernstein(c, bracket);
  if (in0 != in3 && !(in1 != in0 && in2 == in0)) return 0;
  if (in0 == in1 && in0 == in2 && in0 == in3) return 0;
  at = cubic_extrema(c.b1 - c.b0, c.b2 - c.b1, c.b3 - c.b2);
  noise = ISO_CUBIC_NOISE * largest_coefficient(c);
  bracket->lo = 0.0f;
  if (fabs(at.discriminant) <= ISO_CUBIC_NOISE) return ISO_DOUBTFUL;
  for (i = 0; i < 3; ++i) {
    const float s = i == 0 ? at.first : (i == 1 ? at.second : 1.0f);
    float value, derivative;
    int now = in3;
    if (s < 0.0f) continue;
    if (i < 2) {
      value = cubic_value(c, s, &derivative);
      if (fabs(value) <= noise) return ISO_DOUBTFUL;
      now = value >= 0.0f;
    }
    if (now != inside && number-- == 0) {
      bracket->hi = s;
      return 1;
    }
    inside = now;
    bracket->lo = s;
  }
  return 0;
}

/// The same in 48 bits, for the few segments on which isolate_bernstein() is in doubt, and the root
/// itself (lo == hi) by bisection. rounded: the float coefficients, whose end signs neighbouring
/// cells share and which therefore say what is inside at entry and exit.
ISO_INLINE int isolate_precisely(PreciseCubic c, Cubic rounded, Bracket *bracket) {
  const int in0 = rounded.b0 >= 0.0f, in3 = rounded.b3 >= 0.0f;
  const Extrema at = cubic_extrema(tf_sub(c.b[1], c.b[0]).hi, tf_sub(c.b[2], c.b[1]).hi,
                                   tf_sub(c.b[3], c.b[2]).hi);
  float lo = 0.0f, hi = 1.0f;
  int changed = 0, i;
  for (i = 0; i < 2 + 24; ++i) { /* the extrema, then bisection */
    const float s = i == 0 ? at.first : (i == 1 ? at.second : 0.5f * (lo + hi));
    if (i < 2 && (changed || s < 0.0f)) continue;
    if (i == 2 && !changed && in0 == in3) return 0;
    if (precise_cubic_inside(c, s) == in0) {
      lo = s;
    } else {
      hi = s;
      changed = 1;
    }
  }
  bracket->lo = bracket->hi = hi;
  return 1;
}

/// isolate_precisely() for change number `number`, 0: the first.
ISO_INLINE int isolate_change_precisely(PreciseCubic c, Cubic rounded, uint number,
                                        Bracket *bracket) {
  const Extrema at = cubic_extrema(tf_sub(c.b[1], c.b[0]).hi, tf_sub(c.b[2], c.b[1]).hi,
                                   tf_sub(c.b[3], c.b[2]).hi);
  int inside = rounded.b0 >= 0.0f, changed = 0, i;
  float lo = 0.0f, hi = 1.0f;
  for (i = 0; i < 3 && !changed; ++i) {
    const float s = i == 0 ? at.first : (i == 1 ? at.second : 1.0f);
    int now;
    if (s < 0.0f) continue;
    now = i < 2 ? precise_cubic_inside(c, s) : rounded.b3 >= 0.0f;
    if (now != inside && number-- == 0) {
      hi = s;
      changed = 1;
    } else {
      lo = s;
      inside = now;
    }
  }
  if (!changed) return 0;
  for (i = 0; i < 24; ++i) {
    const float s = 0.5f * (lo + hi);
    if (precise_cubic_inside(c, s) == inside) {
      lo = s;
    } else {
      hi = s;
    }
  }
  bracket->lo = bracket->hi = hi;
  return 1;
}

/// Newton, kept in the bracket by bisection.
ISO_INLINE float refine_by_newton(Cubic c, Bracket bracket, int max_steps) {
  const int in_lo = cubic_inside(c, bracket.lo);
  float lo = bracket.lo, hi = bracket.hi;
  float s = 0.5f * (lo + hi);
  int step;
  if (lo == 0.0f && hi == 1.0f)
    s = c.b0 / (c.b0 - c.b3); /* signs differ: the chord's root, in [0,1] */
  for (step = 0; step < max_steps; ++step) {
    float derivative, next;
    const float value = cubic_value(c, s, &derivative);
    if ((value >= 0.0f) == in_lo) {
      lo = s;
    } else {
      hi = s;
    }
    next = s - value / derivative;
    /* Not a root of the other direction just outside; and before the bracket is asked, of which s
     * is an end now. */
    if ((derivative > 0.0f) != in_lo && fabs(next - s) < ISO_ROOT_STEP) return s;
    if (!(next > lo && next < hi)) next = 0.5f * (lo + hi); /* also when derivative = 0 */
    s = next;
  }
  return s;
}

ISO_NAMESPACE_END

#endif
