/// solve_linear.h -- repeated linear interpolation between entry and exit [Neubauer et al. 2002].
///
/// Guarantees: where inside differs between entry and exit, a point whose bracket holds a crossing.
/// Fails: every even number of crossings (a ray that grazes a surface passes through it); of three crossings it may
/// return any; each step of false position keeps one end fixed on convex curves, so convergence is linear and a few
/// steps leave an error that grows with curvature.
#ifndef ISOWAVE_SOLVE_LINEAR_H
#define ISOWAVE_SOLVE_LINEAR_H

#include "cubic.h"

ISO_NAMESPACE_BEGIN

/// False position on [lo, hi], where inside is in_lo at lo and differs at hi; value_lo, value_hi: the curve there.
static inline float false_position(Cubic c, float lo, float hi, float value_lo, float value_hi,
                                   int max_steps) {
  const int in_lo = value_lo >= 0.0f;
  float s = lerp(value_lo / (value_lo - value_hi), lo, hi);
  int step;
  for (step = 0; step < max_steps; ++step) {
    float derivative;
    const float value = cubic_value(c, s, &derivative);
    float next;
    if ((value >= 0.0f) == in_lo) {
      lo = s;
      value_lo = value;
    } else {
      hi = s;
      value_hi = value;
    }
    next = lerp(value_lo / (value_lo - value_hi), lo, hi);
    if (next == s) break;
    s = next;
  }
  return s;
}

static inline int solve_linear(Cubic c, int max_steps, float *s) {
  if ((c.b0 >= 0.0f) == (c.b3 >= 0.0f)) return 0;
  *s = false_position(c, 0.0f, 1.0f, c.b0, c.b3, max_steps);
  return 1;
}

ISO_NAMESPACE_END

#endif
