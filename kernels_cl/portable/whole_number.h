/// whole_number.h -- decoded values of volumes of integers.
///
/// Portable: OpenCL C 1.2 and C++.
#ifndef ISOWAVE_WHOLE_NUMBER_H
#define ISOWAVE_WHOLE_NUMBER_H

#include "shared_types.h"

ISO_NAMESPACE_BEGIN

/// The integer from least to greatest that is next to value; never -0. If the true value is such an
/// integer, and value is off by at most an integer, the result is off by no more.
ISO_INLINE float whole_number(float value, float least, float greatest) {
  const float whole = rint(value);
  const float held = whole < least ? least : whole > greatest ? greatest : whole;
#ifdef __OPENCL_C_VERSION__ /* llvmpipe drops a + 0.0f */
  return as_uint(held) == 0x80000000u ? 0.0f : held;
#else
  return held + 0.0f;
#endif
}

ISO_NAMESPACE_END

#endif
