/// solve_linear.h -- repeated linear interpolation between entry and exit [Neubauer et al. 2002].
///
/// Guarantees: if inside differs between entry and exit, a point whose bracket holds a crossing.
/// Fails: it misses every even number of crossings (a ray that grazes a surface passes through it).
/// It may return any of three crossings. On convex curves, each step of false position keeps one
/// end fixed, so convergence is linear, and a few steps leave an error that grows with curvature.
#ifndef ISOWAVE_SOLVE_LINEAR_H
#define ISOWAVE_SOLVE_LINEAR_H

#include "cubic.h"

ISO_NAMESPACE_BEGIN

ISO_INLINE int isolate_linear(Cubic c, Bracket *bracket) {
  bracket->lo = 0.0f;
  bracket->hi = 1.0f;
  return (c.b0 >= 0.0f) != (c.b3 >= 0.0f);
}

/// False position: the chord's root again and again, kept on the side where inside changes.
ISO_INLINE float refine_by_chords(Cubic c, Bracket bracket, int max_steps) {
  float lo = bracket.lo, hi = bracket.hi, s, derivative;
  float value_lo = cubic_value(c, lo, &derivative), value_hi = cubic_value(c, hi, &derivative);
  const int in_lo = value_lo >= 0.0f;
  int step;
  s = lerp(value_lo / (value_lo - value_hi), lo, hi);
  for (step = 0; step < max_steps; ++step) {
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

ISO_NAMESPACE_END

#endif
