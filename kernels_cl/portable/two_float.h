/// two_float.h -- numbers of about 48 bits as unevaluated sums of two floats [Dekker 1971, Knuth].
/// Portable: OpenCL C 1.2 and C++; fp64 is optional on devices.
#ifndef ISOWAVE_TWO_FLOAT_H
#define ISOWAVE_TWO_FLOAT_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

/// hi + lo, |lo| <= ulp(hi) / 2.
typedef struct TwoFloat {
  float hi, lo;
} TwoFloat;

ISO_INLINE int t_less(TwoFloat a, TwoFloat b) {
  return a.hi < b.hi || (a.hi == b.hi && a.lo < b.lo);
}

ISO_INLINE TwoFloat two_float(float x) {
  TwoFloat r;
  r.hi = x;
  r.lo = 0.0f;
  return r;
}

/// a + b exactly, for |a| >= |b|.
ISO_INLINE TwoFloat fast_two_sum(float a, float b) {
  TwoFloat r;
  r.hi = a + b;
  r.lo = b - (r.hi - a);
  return r;
}

/// a + b exactly.
ISO_INLINE TwoFloat two_sum(float a, float b) {
  TwoFloat r;
  float b_part;
  r.hi = a + b;
  b_part = r.hi - a;
  r.lo = (a - (r.hi - b_part)) + (b - b_part);
  return r;
}

/// The sum, with a relative error of 2^-45 or so if it does not cancel; otherwise with an error
/// below that of the larger operand.
ISO_INLINE TwoFloat tf_add(TwoFloat a, TwoFloat b) {
  const TwoFloat high = two_sum(a.hi, b.hi), low = two_sum(a.lo, b.lo);
  const TwoFloat sum = fast_two_sum(high.hi, high.lo + low.hi);
  return fast_two_sum(sum.hi, sum.lo + low.lo);
}

ISO_INLINE TwoFloat tf_sub(TwoFloat a, TwoFloat b) {
  TwoFloat minus_b; /* not b itself: rusticl changes the caller's struct with a parameter */
  minus_b.hi = -b.hi;
  minus_b.lo = -b.lo;
  return tf_add(a, minus_b);
}

ISO_INLINE TwoFloat tf_mul(TwoFloat a, TwoFloat b) {
  const float high = a.hi * b.hi;
  return fast_two_sum(high, fma(a.hi, b.hi, -high) + fma(a.hi, b.lo, a.lo * b.hi));
}

/// a at u = 0, b at u = 1 but for rounding.
ISO_INLINE TwoFloat tf_lerp(float u, TwoFloat a, TwoFloat b) {
  return tf_add(a, tf_mul(two_float(u), tf_sub(b, a)));
}

ISO_NAMESPACE_END

#endif
