/// float8.h -- eight float32 or int32 at a time: what portable/packet.h needs, as
/// core/host/float8.hpp has it for C++. OpenCL C 1.2.
#ifndef ISOWAVE_FLOAT8_H
#define ISOWAVE_FLOAT8_H

#include "portable/shared_types.h"

#define ISO_PACKET_NAMESPACE_BEGIN
#define ISO_PACKET_NAMESPACE_END
#define ISO_UNLIKELY(condition) (condition)
/// A function that is called so rarely, or so seldom, that it must not burden its callers.
#define ISO_RARE static __attribute__((noinline))
#define ISO_SELDOM static __attribute__((noinline))
/// A loop over 0, 1, 2, unrolled: else what it goes through would be kept in memory.
#define ISO_EACH_OF_3(i) _Pragma("unroll") for (int i = 0; i < 3; ++i)
/// A loop over the lanes of a mask.
#define ISO_EACH_LANE(lane, mask)                                                          \
  for (uint left_##lane = bits_of(mask), lane = first_lane(left_##lane); left_##lane != 0; \
       left_##lane &= left_##lane - 1, lane = first_lane(left_##lane))

typedef float8 Floats;
typedef int8 Ints;
typedef int8 Mask;  ///< -1 or 0 in each lane

#define floats(x) ((float8)(x))
#define ints(x) ((int8)(x))
#define to_floats(x) convert_float8(x)
/// Towards 0.
#define to_ints(x) convert_int8(x)
/// a in the lanes of a mask, b in others.
#define pick(mask, a, b) select(b, a, mask)
#define smaller(a, b) select(b, a, (a) < (b))
#define larger(a, b) select(b, a, (a) > (b))

#if defined(__AVX__)
typedef float FloatRegister __attribute__((__vector_size__(32)));
#endif

/// 1 << n, of n from 0 to 31.
#define bit_at(n) ((int8)(1) << (n))

/// The nearest whole numbers, of two the even one.
ISO_INLINE Floats to_nearest(Floats x) {
#if defined(__AVX__) /* else drivers may take twenty instructions */
  return __builtin_astype(__builtin_ia32_roundps256(__builtin_astype(x, FloatRegister), 8), Floats);
#else
  return rint(x);
#endif
}

/// Lane i in bit i.
ISO_INLINE uint bits_of(Mask mask) {
#if defined(__AVX__) /* else compilers combine lane after lane, which takes ten times as long */
  return (uint)__builtin_ia32_movmskps256(__builtin_astype(mask, FloatRegister));
#else
  const int8 bits = mask & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
  const int4 four = bits.lo | bits.hi;
  const int2 two = four.lo | four.hi;
  return (uint)(two.x | two.y);
#endif
}
/// As the function of OpenCL C, faster.
#undef any
#define any(mask) (bits_of(mask) != 0)
ISO_INLINE uint first_lane(uint bits) {
  return 31u - clz(bits & (0u - bits));
}

/// columns [j] = element j of each of rows [8]. Element by element, for Oclgrind
/// (kernels_cl/README.md); compilers make shuffles of whole vectors of it.
ISO_INLINE void transpose(const float8 *rows, float8 *columns) {
  float8 a[8], b[8];
  _Pragma("unroll") for (int i = 0; i < 8; i += 2) {
    const float8 r = rows[i], s = rows[i + 1];
    a[i] = (float8)(r.s0, s.s0, r.s1, s.s1, r.s4, s.s4, r.s5, s.s5);
    a[i + 1] = (float8)(r.s2, s.s2, r.s3, s.s3, r.s6, s.s6, r.s7, s.s7);
  }
  _Pragma("unroll") for (int i = 0; i < 4; ++i) {
    const float8 r = a[i / 2 * 4 + i % 2], s = a[i / 2 * 4 + i % 2 + 2];
    b[i / 2 * 4 + i % 2 * 2] = (float8)(r.s0, r.s1, s.s0, s.s1, r.s4, r.s5, s.s4, s.s5);
    b[i / 2 * 4 + i % 2 * 2 + 1] = (float8)(r.s2, r.s3, s.s2, s.s3, r.s6, r.s7, s.s6, s.s7);
  }
  _Pragma("unroll") for (int i = 0; i < 4; ++i) {
    const float8 r = b[i], s = b[4 + i];
    columns[i] = (float8)(r.s0, r.s1, r.s2, r.s3, s.s0, s.s1, s.s2, s.s3);
    columns[4 + i] = (float8)(r.s4, r.s5, r.s6, r.s7, s.s4, s.s5, s.s6, s.s7);
  }
}

// Stores past the processor's caches, of what it will not read soon: it need not fetch what was
// there before. `to` is a multiple of 32 bytes. A work-item that has done so calls end_streams()
// before others may read.
#if defined(__AVX__)
#define stream_out(x, to) __builtin_nontemporal_store(x, to)
#define end_streams() __builtin_ia32_sfence()
#else
#define stream_out(x, to) (*(to) = (x))
#define end_streams()
#endif

#endif
