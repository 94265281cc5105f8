#pragma once
// float8.hpp by SSE4.1, which has registers of four, and no fused multiply-add.

#include "core/host/float8.hpp"

namespace isowave::core::ISO_PACKET_NAMESPACE {

using Half = float __attribute__((vector_size(16), may_alias));  ///< four lanes; __m128
using HalfInts = std::int32_t __attribute__((vector_size(16), may_alias));

template <class Lane>
struct HalfOf {
  using Type = Half;
};
template <>
struct HalfOf<std::int32_t> {
  using Type = HalfInts;
};

/// Two halves, since compilers compare vectors of eight lane by lane where registers have four.
template <class Lane>
struct Eight {
  using Four = typename HalfOf<Lane>::Type;
  Four low, high;

  Eight() = default;
  Eight(Four a, Four b) : low(a), high(b) {}
  // The same number in all lanes, as vectors take it in arithmetic.
  Eight(Lane x) : low{x, x, x, x}, high{x, x, x, x} {}
  Eight(Lane a, Lane b, Lane c, Lane d, Lane e, Lane f, Lane g, Lane h)
      : low{a, b, c, d}, high{e, f, g, h} {}

  Lane &operator[](std::size_t lane) { return reinterpret_cast<Lane *>(this)[lane]; }
  Lane operator[](std::size_t lane) const { return reinterpret_cast<const Lane *>(this)[lane]; }

  friend Eight operator-(Eight a) { return {-a.low, -a.high}; }
  friend Eight operator~(Eight a) { return {~a.low, ~a.high}; }
// NOLINTBEGIN(bugprone-macro-parentheses): an operator
#define ISO_BY_HALVES(op)                           \
  friend Eight operator op(Eight a, Eight b) {      \
    return {a.low op b.low, a.high op b.high};      \
  }                                                 \
  friend Eight &operator op##=(Eight &a, Eight b) { \
    return a = a op b;                              \
  }
  ISO_BY_HALVES(+)
  ISO_BY_HALVES(-)
  ISO_BY_HALVES(*)
  ISO_BY_HALVES(/)
  ISO_BY_HALVES(&)
  ISO_BY_HALVES(|)
  ISO_BY_HALVES(^)
  ISO_BY_HALVES(<<)
  ISO_BY_HALVES(>>)
#undef ISO_BY_HALVES
#define ISO_BY_HALVES(op)                                          \
  friend Eight<std::int32_t> operator op(Eight a, Eight b) {       \
    return {HalfInts(a.low op b.low), HalfInts(a.high op b.high)}; \
  }
  ISO_BY_HALVES(==)
  ISO_BY_HALVES(!=)
  ISO_BY_HALVES(<)
  ISO_BY_HALVES(<=)
  ISO_BY_HALVES(>)
  ISO_BY_HALVES(>=)
#undef ISO_BY_HALVES
  // NOLINTEND(bugprone-macro-parentheses)
};
using Floats = Eight<float>;
using Ints = Eight<std::int32_t>;
using Mask = Ints;  ///< -1 or 0 in each lane

inline Floats floats(float x) {
  return x;
}
inline Ints ints(int x) {
  return x;
}
inline Floats to_floats(Ints x) {
  return {__builtin_convertvector(x.low, Half), __builtin_convertvector(x.high, Half)};
}
/// Towards 0.
inline Ints to_ints(Floats x) {
  return {__builtin_convertvector(x.low, HalfInts), __builtin_convertvector(x.high, HalfInts)};
}

/// The same bits as the other kind.
inline Floats as_floats(Ints x) {
  return {reinterpret_cast<Half>(x.low), reinterpret_cast<Half>(x.high)};
}
inline Ints as_ints(Floats x) {
  return {reinterpret_cast<HalfInts>(x.low), reinterpret_cast<HalfInts>(x.high)};
}

inline Floats fabs(Floats x) {
  return as_floats(as_ints(x) & 0x7FFFFFFF);
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

/// Gives lanes the halves of each one's 64-bit number. numbers: below 2^31.
inline void gather_halves(const ulong *from, Ints numbers, Mask lanes, Ints *low, Ints *high) {
  ISO_EACH_LANE(lane, lanes) {
    const ulong number = from[numbers[lane]];
    (*low)[lane] = static_cast<int>(number);
    (*high)[lane] = static_cast<int>(number >> 32);
  }
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE
