/// cubic.h -- the field along a ray's segment in one cell, as a cubic in Bernstein form.
/// Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_CUBIC_H
#define ISOWAVE_CUBIC_H

#include "two_float.h"

ISO_NAMESPACE_BEGIN

/// a at u = 0 and b at u = 1, exactly; between them in sign and, but for rounding, in value.
ISO_INLINE float lerp(float u, float a, float b) {
  return fma(u, b, fma(-u, a, a));
}

/// Bernstein coefficients on s in [0,1], isovalue subtracted.
typedef struct Cubic {
  float b0, b1, b2, b3;
} Cubic;

/// A part of [0,1] at whose ends inside (value >= 0) differs; lo == hi: a root itself.
typedef struct Bracket {
  float lo, hi;
} Bracket;

/// De Casteljau's value and derivative of the cubic at s.
ISO_INLINE float cubic_value(Cubic c, float s, float *derivative) {
  const float c0 = lerp(s, c.b0, c.b1), c1 = lerp(s, c.b1, c.b2), c2 = lerp(s, c.b2, c.b3);
  const float d0 = lerp(s, c0, c1), d1 = lerp(s, c1, c2);
  *derivative = 3.0f * (d1 - d0);
  return lerp(s, d0, d1);
}

ISO_INLINE int cubic_inside(Cubic c, float s) {
  float derivative;
  return cubic_value(c, s, &derivative) >= 0.0f;
}

/// The same coefficients with about 48 bits.
typedef struct PreciseCubic {
  TwoFloat b[4];
} PreciseCubic;

ISO_INLINE PreciseCubic widened(Cubic c) {
  PreciseCubic p;
  p.b[0] = two_float(c.b0);
  p.b[1] = two_float(c.b1);
  p.b[2] = two_float(c.b2);
  p.b[3] = two_float(c.b3);
  return p;
}

ISO_INLINE int precise_cubic_inside(PreciseCubic cubic, float s) {
  PreciseCubic c = cubic; /* see tf_sub() */
  int i, n;
  for (n = 3; n > 0; --n) {
    for (i = 0; i < n; ++i) c.b[i] = tf_lerp(s, c.b[i], c.b[i + 1]);
  }
  return c.b[0].hi >= 0.0f; /* lo cannot change the sign */
}

/// The cubic as p3 s^3 + p2 s^2 + p1 s + p0: the form most of the literature works in. Its
/// coefficients are differences of the Bernstein ones, so they carry the rounding of the largest of
/// those.
typedef struct PowerCubic {
  float p3, p2, p1, p0;
} PowerCubic;

ISO_INLINE PowerCubic power_form(Cubic c) {
  PowerCubic p;
  p.p0 = c.b0;
  p.p1 = 3.0f * (c.b1 - c.b0);
  p.p2 = 3.0f * ((c.b2 - c.b1) - (c.b1 - c.b0));
  p.p3 = (c.b3 - c.b0) - 3.0f * (c.b2 - c.b1);
  return p;
}

ISO_INLINE float power_value(PowerCubic p, float s) {
  return fma(fma(fma(p.p3, s, p.p2), s, p.p1), s, p.p0);
}

ISO_NAMESPACE_END

#endif
