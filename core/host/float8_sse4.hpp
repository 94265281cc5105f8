#pragma once
// float8.hpp by SSE4.1, which has registers of four, and no fused multiply-add.

#include "core/host/float8.hpp"

namespace isowave::core::ISO_PACKET_NAMESPACE {

using Half = __m128;  ///< four lanes

struct Halves {
  Half low, high;
};

inline Halves halves(Floats x) {
  return std::bit_cast<Halves>(x);
}
inline Halves halves(Ints x) {
  return std::bit_cast<Halves>(x);
}
inline Floats joined(Half low, Half high) {
  return std::bit_cast<Floats>(Halves{low, high});
}

/// Lane i in bit i.
inline unsigned bits_of(Mask mask) {
  const Halves x = halves(mask);
  return static_cast<unsigned>(_mm_movemask_ps(x.low) | _mm_movemask_ps(x.high) << 4);
}
inline bool any(Mask mask) {
  return bits_of(mask) != 0;
}

/// a in the lanes of a mask, b in others.
inline Floats pick(Mask mask, Floats a, Floats b) {
  const Halves m = halves(mask), x = halves(a), y = halves(b);
  return joined(_mm_blendv_ps(y.low, x.low, m.low), _mm_blendv_ps(y.high, x.high, m.high));
}
inline Ints pick(Mask mask, Ints a, Ints b) {
  return std::bit_cast<Ints>(pick(mask, std::bit_cast<Floats>(a), std::bit_cast<Floats>(b)));
}

inline Floats smaller(Floats a, Floats b) {
  const Halves x = halves(a), y = halves(b);
  return joined(_mm_min_ps(x.low, y.low), _mm_min_ps(x.high, y.high));
}
inline Floats larger(Floats a, Floats b) {
  const Halves x = halves(a), y = halves(b);
  return joined(_mm_max_ps(x.low, y.low), _mm_max_ps(x.high, y.high));
}
inline Ints joined(__m128i low, __m128i high) {
  return std::bit_cast<Ints>(Halves{_mm_castsi128_ps(low), _mm_castsi128_ps(high)});
}
inline Ints smaller(Ints a, Ints b) {
  const Halves x = halves(a), y = halves(b);
  return joined(_mm_min_epi32(_mm_castps_si128(x.low), _mm_castps_si128(y.low)),
                _mm_min_epi32(_mm_castps_si128(x.high), _mm_castps_si128(y.high)));
}
inline Ints larger(Ints a, Ints b) {
  const Halves x = halves(a), y = halves(b);
  return joined(_mm_max_epi32(_mm_castps_si128(x.low), _mm_castps_si128(y.low)),
                _mm_max_epi32(_mm_castps_si128(x.high), _mm_castps_si128(y.high)));
}

/// Of the two lower lanes, in those. The product is exact in float64. The sum is rounded to odd:
/// where it is not exact, and its last bit 0, it becomes the neighbour on the other side of what is
/// exact, whose last bit is 1. So rounding it to float32, which has less than half as many bits,
/// has the result of rounding once (Boldo and Melquiond, Emulation of FMA, 2008).
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
inline Half fma_of_half(Half a, Half b, Half c) {
  return _mm_movelh_ps(fma_of_two(a, b, c),
                       fma_of_two(_mm_movehl_ps(a, a), _mm_movehl_ps(b, b), _mm_movehl_ps(c, c)));
}
inline Floats fma(Floats a, Floats b, Floats c) {
  const Halves x = halves(a), y = halves(b), z = halves(c);
  return joined(fma_of_half(x.low, y.low, z.low), fma_of_half(x.high, y.high, z.high));
}

inline Floats sqrt(Floats a) {
  const Halves x = halves(a);
  return joined(_mm_sqrt_ps(x.low), _mm_sqrt_ps(x.high));
}
inline Floats floor(Floats a) {
  const Halves x = halves(a);
  return joined(_mm_floor_ps(x.low), _mm_floor_ps(x.high));
}
/// The nearest whole number; halves to an even one.
inline Floats rint(Floats a) {
  constexpr int kNearest = _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC;
  const Halves x = halves(a);
  return joined(_mm_round_ps(x.low, kNearest), _mm_round_ps(x.high, kNearest));
}

/// Gives lanes the halves of each one's 64-bit number. numbers: below 2^31.
inline void gather_halves(const ulong *from, Ints numbers, Mask lanes, Ints *low, Ints *high) {
  ISO_EACH_LANE(lane, lanes) {
    const ulong number = from[numbers[lane]];
    (*low)[lane] = static_cast<int>(number);
    (*high)[lane] = static_cast<int>(number >> 32);
  }
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE
