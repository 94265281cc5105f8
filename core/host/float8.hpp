#pragma once
// Eight float32 or int32 at a time, by AVX2 and fused multiply-add. For host_packets.cpp alone,
// which compiles it for processors that have these.

#include <immintrin.h>

#include <bit>
#include <cstdint>

#include "kernels_cl/portable/shared_types.h"

namespace isowave::core::packets {

using Floats = float __attribute__((vector_size(32)));
using Ints = std::int32_t __attribute__((vector_size(32)));
using Mask = Ints;  ///< -1 or 0 in each lane

inline constexpr int kLanes = 8;

inline Floats eight(float x) {
  return Floats{x, x, x, x, x, x, x, x};
}
inline Ints eight(int x) {
  return Ints{x, x, x, x, x, x, x, x};
}

/// Lane i in bit i.
inline unsigned bits_of(Mask mask) {
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
}
inline bool any(Mask mask) {
  return bits_of(mask) != 0;
}

/// Calls body(lane) for each lane of a mask.
template <class Body>
inline void for_each_lane(Mask mask, Body body) {
  for (unsigned bits = bits_of(mask); bits != 0; bits &= bits - 1) body(std::countr_zero(bits));
}

/// Calls body(axis) for 0, 1, 2. Compilers leave loops of long bodies as they are.
template <class Body>
inline void for_each_axis(Body body) {
  body(0);
  body(1);
  body(2);
}

inline Floats to_floats(Ints x) {
  return __builtin_convertvector(x, Floats);
}
/// Towards 0.
inline Ints to_ints(Floats x) {
  return __builtin_convertvector(x, Ints);
}

/// a in the lanes of a mask, b in others. What compilers make of mask ? a : b compares the mask
/// with 0 first.
inline Floats select(Mask mask, Floats a, Floats b) {
  return reinterpret_cast<Floats>(_mm256_blendv_ps(
      reinterpret_cast<__m256>(b), reinterpret_cast<__m256>(a), reinterpret_cast<__m256>(mask)));
}
inline Ints select(Mask mask, Ints a, Ints b) {
  return reinterpret_cast<Ints>(
      select(mask, reinterpret_cast<Floats>(a), reinterpret_cast<Floats>(b)));
}

inline Floats smaller(Floats a, Floats b) {
  return a < b ? a : b;
}
inline Floats larger(Floats a, Floats b) {
  return a > b ? a : b;
}
inline Ints smaller(Ints a, Ints b) {
  return a < b ? a : b;
}
inline Ints larger(Ints a, Ints b) {
  return a > b ? a : b;
}

inline Floats fabs(Floats x) {
  return reinterpret_cast<Floats>(reinterpret_cast<Ints>(x) & 0x7FFFFFFF);
}

inline Floats fma(Floats a, Floats b, Floats c) {
  return reinterpret_cast<Floats>(_mm256_fmadd_ps(
      reinterpret_cast<__m256>(a), reinterpret_cast<__m256>(b), reinterpret_cast<__m256>(c)));
}
inline Floats sqrt(Floats x) {
  return reinterpret_cast<Floats>(_mm256_sqrt_ps(reinterpret_cast<__m256>(x)));
}
inline Floats floor(Floats x) {
  return reinterpret_cast<Floats>(_mm256_floor_ps(reinterpret_cast<__m256>(x)));
}
/// The nearest whole number; halves to an even one.
inline Floats nearest(Floats x) {
  return reinterpret_cast<Floats>(
      _mm256_round_ps(reinterpret_cast<__m256>(x), _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC));
}

/// Gives lanes the halves of each one's 64-bit number. numbers: below 2^31.
inline void gather_halves(const ulong *from, Ints numbers, Mask lanes, Ints *low, Ints *high) {
  const int *halves = reinterpret_cast<const int *>(from);
  const auto gather = [&](const int *base, Ints before) {
    return reinterpret_cast<Ints>(_mm256_mask_i32gather_epi32(
        reinterpret_cast<__m256i>(before), base, reinterpret_cast<__m256i>(numbers),
        reinterpret_cast<__m256i>(lanes), sizeof(ulong)));
  };
  *low = gather(halves, *low);
  *high = gather(halves + 1, *high);
}

}  // namespace isowave::core::packets
