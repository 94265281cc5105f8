#pragma once
// float8.hpp where registers have four lanes: what float8_sse4.hpp and float8_wasm.hpp share.

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

/// The number, as one that was not loaded just now: kernels_cl/portable/fma_by_wasm.h says why.
template <class Lane>
inline Lane not_loaded(Lane x) {
#ifdef __wasm__
  if (!__builtin_constant_p(x)) asm("" : "+r"(x));
#endif
  return x;
}

/// Two halves, since compilers compare vectors of eight lane by lane where registers have four.
template <class Lane>
struct Eight {
  using Four = typename HalfOf<Lane>::Type;
  Four low, high;

  Eight() = default;
  Eight(Four a, Four b) : low(a), high(b) {}
  // The same number in all lanes, as vectors take it in arithmetic.
  Eight(Lane x) {
    x = not_loaded(x);
    low = high = Four{x, x, x, x};
  }
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
inline unsigned bits_of(Mask mask);

/// Gives lanes the halves of each one's 64-bit number. numbers: below 2^31.
inline void gather_halves(const ulong *from, Ints numbers, Mask lanes, Ints *low, Ints *high) {
  ISO_EACH_LANE(lane, lanes) {
    const ulong number = from[numbers[lane]];
    (*low)[lane] = static_cast<int>(number);
    (*high)[lane] = static_cast<int>(number >> 32);
  }
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE
