#pragma once
// float8.hpp by WebAssembly's relaxed vectors, in browsers that fuse multiply-adds. Clang 14 writes
// opcodes of a draft, which tools/page/relaxed.py replaces.

#include <wasm_simd128.h>

#include "core/host/float8_halves.hpp"

namespace isowave::core::ISO_PACKET_NAMESPACE {

inline v128_t bits_of_half(Half x) {
  return reinterpret_cast<v128_t>(x);
}
inline Half half_of(v128_t x) {
  return reinterpret_cast<Half>(x);
}

/// Towards 0. Numbers that int32 has not become any.
inline Ints to_ints(Floats x) {
  return {reinterpret_cast<HalfInts>(__builtin_wasm_relaxed_trunc_s_i32x4_f32x4(x.low)),
          reinterpret_cast<HalfInts>(__builtin_wasm_relaxed_trunc_s_i32x4_f32x4(x.high))};
}

/// 1 << n, of n from 0 to 31: vectors are shifted by one number. The float32 -2^n, as an integer.
inline Ints bit_at(Ints n) {
  return -to_ints(as_floats((n << 23) + static_cast<int>(0xBF800000u)));
}

/// Lane i in bit i.
inline unsigned bits_of(Mask mask) {
  const Floats x = as_floats(mask);
  return wasm_i32x4_bitmask(bits_of_half(x.low)) | wasm_i32x4_bitmask(bits_of_half(x.high)) << 4;
}
inline bool any(Mask mask) {
  return wasm_v128_any_true(reinterpret_cast<v128_t>(mask.low | mask.high));
}

/// a in the lanes of a mask, b in others.
inline Ints pick(Mask mask, Ints a, Ints b) {
  return {reinterpret_cast<HalfInts>(__builtin_wasm_laneselect_i32x4(a.low, b.low, mask.low)),
          reinterpret_cast<HalfInts>(__builtin_wasm_laneselect_i32x4(a.high, b.high, mask.high))};
}
inline Floats pick(Mask mask, Floats a, Floats b) {
  return as_floats(pick(mask, as_ints(a), as_ints(b)));
}

inline Floats smaller(Floats a, Floats b) {
  return {half_of(wasm_f32x4_pmin(bits_of_half(b.low), bits_of_half(a.low))),
          half_of(wasm_f32x4_pmin(bits_of_half(b.high), bits_of_half(a.high)))};
}
inline Floats larger(Floats a, Floats b) {
  return {half_of(wasm_f32x4_pmax(bits_of_half(b.low), bits_of_half(a.low))),
          half_of(wasm_f32x4_pmax(bits_of_half(b.high), bits_of_half(a.high)))};
}
inline Ints smaller(Ints a, Ints b) {
  return pick(a < b, a, b);
}
inline Ints larger(Ints a, Ints b) {
  return pick(a > b, a, b);
}

inline Floats fma(Floats a, Floats b, Floats c) {
  return {__builtin_wasm_fma_f32x4(a.low, b.low, c.low),
          __builtin_wasm_fma_f32x4(a.high, b.high, c.high)};
}
inline Floats sqrt(Floats x) {
  return {half_of(wasm_f32x4_sqrt(bits_of_half(x.low))),
          half_of(wasm_f32x4_sqrt(bits_of_half(x.high)))};
}
/// The nearest whole number; halves to an even one.
inline Floats to_nearest(Floats x) {
  return {half_of(wasm_f32x4_nearest(bits_of_half(x.low))),
          half_of(wasm_f32x4_nearest(bits_of_half(x.high)))};
}
inline Floats floor(Floats x) {
  return {half_of(wasm_f32x4_floor(bits_of_half(x.low))),
          half_of(wasm_f32x4_floor(bits_of_half(x.high)))};
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE
