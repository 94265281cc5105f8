/// solve_marmitt.h -- split at the derivative's roots, then repeated linear interpolation [Marmitt
/// et al. 2004].
///
/// Guarantees: the first crossing, as long as the extrema that separate crossings are found.
/// Fails: the extrema come from the quadratic formula in power form. b^2 - 4ac cancels if they lie
/// close together, so pairs of crossings there (grazing rays) are lost. Dividing by 2a throws away
/// the extremum that stays when the cubic's leading coefficient vanishes against the others. The
/// refinement converges as slowly as in solve_linear.h.
#ifndef ISOWAVE_SOLVE_MARMITT_H
#define ISOWAVE_SOLVE_MARMITT_H

#include "solve_linear.h"

ISO_NAMESPACE_BEGIN

ISO_INLINE int isolate_marmitt(Cubic c, Bracket *bracket) {
  const PowerCubic p = power_form(c);
  const float qa = 3.0f * p.p3, qb = 2.0f * p.p2, qc = p.p1; /* the derivative */
  const float discriminant = qb * qb - 4.0f * qa * qc;
  const int in0 = c.b0 >= 0.0f;
  int in_hi = c.b3 >= 0.0f;
  bracket->lo = 0.0f;
  bracket->hi = 1.0f;
  if (discriminant >= 0.0f) { /* also false when it is not a number */
    const float root = sqrt(discriminant);
    const float e0 = (-qb - root) / (2.0f * qa), e1 = (-qb + root) / (2.0f * qa);
    const float first = e0 < e1 ? e0 : e1, second = e0 < e1 ? e1 : e0;
    int i;
    for (i = 0; i < 2; ++i) {
      const float e = i == 0 ? first : second;
      float derivative;
      int in;
      if (!(e > bracket->lo && e < bracket->hi)) continue;
      in = cubic_value(c, e, &derivative) >= 0.0f;
      if (in == in0) {
        bracket->lo = e;
      } else {
        bracket->hi = e;
        in_hi = in;
      }
    }
  }
  return in_hi != in0;
}

ISO_NAMESPACE_END

#endif
