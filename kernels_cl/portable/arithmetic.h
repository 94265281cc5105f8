/// arithmetic.h -- the operations on which the bits of a picture depend, for the host and for
/// devices. C99 that is also C++.
#ifndef ISOWAVE_ARITHMETIC_H
#define ISOWAVE_ARITHMETIC_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

typedef struct Operands {
  float a, b, c;  ///< normal numbers; b is not 0
  float tiny;     ///< a power of two: times a, it is denormal
  ulong x, y;     ///< any
} Operands;
ISO_CHECK_SIZE(Operands, 32);

/// One word or two for each kind of operation.
typedef struct Results {
  float sum, product;  ///< rounded to nearest
  float contracted;    ///< a * b + c, rounded twice: contraction rounds it once
  float fused;         ///< fma(a, b, c), rounded once
  float quotient, root;
  float denormal;
  float rounded;      ///< floor() and the conversion to an integer
  ulong whole, high;  ///< 64-bit integers: products, shifts, and bits
} Results;
ISO_CHECK_SIZE(Results, 48);

ISO_INLINE Results compute(const Operands *given) {
  const float a = given->a, b = given->b, c = given->c;
  Results r;
  r.sum = a + c;
  r.product = a * b;
  r.contracted = a * b + c;
  r.fused = fma(a, b, c);
  r.quotient = a / b;
  r.root = sqrt(fabs(a));
  r.denormal = a * given->tiny;
  r.rounded = (float)(int)floor(c) + floor(a);
  r.whole = given->x * given->y + (given->x >> (given->y & 63u));
  r.high = ((given->x << (given->y >> 58)) ^ given->y) + popcount((uint)(given->x >> 32));
  return r;
}

ISO_NAMESPACE_END

#endif
