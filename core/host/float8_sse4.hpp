#pragma once
// float8.hpp by SSE4.1, which has registers of four, and no fused multiply-add.

#include "core/host/float8_halves.hpp"

namespace isowave::core::ISO_PACKET_NAMESPACE {

/// Towards 0.
inline Ints to_ints(Floats x) {
  return {__builtin_convertvector(x.low, HalfInts), __builtin_convertvector(x.high, HalfInts)};
}

/// 1 << n, of n from 0 to 31.
inline Ints bit_at(Ints n) {
  return ints(1) << n;
}

/// Lane i in bit i.
inline unsigned bits_of(Mask mask) {
  const Floats x = as_floats(mask);
  return static_cast<unsigned>(_mm_movemask_ps(x.low) | _mm_movemask_ps(x.high) << 4);
}
inline bool any(Mask mask) {
  return bits_of(mask) != 0;
}

/// a in the lanes of a mask, b in others.
inline Floats pick(Mask mask, Floats a, Floats b) {
  const Floats m = as_floats(mask);
  return {_mm_blendv_ps(b.low, a.low, m.low), _mm_blendv_ps(b.high, a.high, m.high)};
}
inline Ints pick(Mask mask, Ints a, Ints b) {
  return as_ints(pick(mask, as_floats(a), as_floats(b)));
}

inline Floats smaller(Floats a, Floats b) {
  return {_mm_min_ps(a.low, b.low), _mm_min_ps(a.high, b.high)};
}
inline Floats larger(Floats a, Floats b) {
  return {_mm_max_ps(a.low, b.low), _mm_max_ps(a.high, b.high)};
}
inline Ints smaller(Ints a, Ints b) {
  return pick(a < b, a, b);
}
inline Ints larger(Ints a, Ints b) {
  return pick(a > b, a, b);
}

/// Fused multiply-add of the two lower lanes. The product is exact in float64. The sum is rounded
/// to odd: if the sum is inexact and its last bit is 0, it becomes the neighbour on the other side
/// of the exact sum, whose last bit is 1. So rounding the sum to float32, which has less than half
/// as many bits, has the result of rounding once (Boldo and Melquiond, Emulation of FMA, 2008).
inline Half fma_of_two(Half a, Half b, Half c) {
  const __m128d product = _mm_mul_pd(_mm_cvtps_pd(a), _mm_cvtps_pd(b)), addend = _mm_cvtps_pd(c);
  const __m128d sum = _mm_add_pd(product, addend), back = _mm_sub_pd(sum, product);
  const __m128d error =
      _mm_add_pd(_mm_sub_pd(product, _mm_sub_pd(sum, back)),
                 _mm_sub_pd(addend, back)); /* exact; NaN of a sum that is not finite */
  const __m128d zero = _mm_setzero_pd();
  const __m128i one = _mm_set1_epi64x(1), bits = _mm_castpd_si128(sum);
  const __m128d is_inexact = _mm_or_pd(_mm_cmplt_pd(error, zero), _mm_cmpgt_pd(error, zero));
  const __m128i is_odd = _mm_sub_epi64(_mm_andnot_si128(bits, one), one); /* -1, else 0 */
  /* 1 away from zero, where error and sum have the same sign, or -1 towards it. */
  const __m128i signs = _mm_castpd_si128(_mm_xor_pd(error, sum)),
                step = _mm_or_si128(_mm_shuffle_epi32(_mm_srai_epi32(signs, 31), 0xF5), one),
                moved = _mm_and_si128(_mm_andnot_si128(is_odd, step), _mm_castpd_si128(is_inexact));
  return _mm_cvtpd_ps(_mm_castsi128_pd(_mm_add_epi64(bits, moved)));
}
/// A call: there are many, and it is long.
[[maybe_unused]] static __attribute__((noinline)) Half fma_of_half(Half a, Half b, Half c) {
  return _mm_movelh_ps(fma_of_two(a, b, c),
                       fma_of_two(_mm_movehl_ps(a, a), _mm_movehl_ps(b, b), _mm_movehl_ps(c, c)));
}
inline Floats fma(Floats a, Floats b, Floats c) {
  return {fma_of_half(a.low, b.low, c.low), fma_of_half(a.high, b.high, c.high)};
}

inline Floats sqrt(Floats x) {
  return {_mm_sqrt_ps(x.low), _mm_sqrt_ps(x.high)};
}
inline Floats floor(Floats x) {
  return {_mm_floor_ps(x.low), _mm_floor_ps(x.high)};
}
/// The nearest whole number; halves to an even one.
inline Floats to_nearest(Floats x) {
  constexpr int kNearest = _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC;
  return {_mm_round_ps(x.low, kNearest), _mm_round_ps(x.high, kNearest)};
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE
