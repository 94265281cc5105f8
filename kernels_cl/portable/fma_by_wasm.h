/// fma_by_wasm.h -- fma() of float32 by WebAssembly's f32x4.relaxed_madd, for modules that only run
/// where it is fused, or is replaced (tools/page/relaxed.py). C++ alone.
///
/// Clang 14 makes one instruction of a scalar's load and its copy to all lanes (v128.load32_splat),
/// and may put it behind stores to the same address, such as those to the next variable of a stack
/// slot. At -O2, rays then met other surfaces behind translucent ones. A scalar that has gone
/// through an empty asm is no load, so nothing is moved.
#ifndef ISOWAVE_FMA_BY_WASM_H
#define ISOWAVE_FMA_BY_WASM_H

namespace isowave::core {

using FourLanes = float __attribute__((vector_size(16)));

inline FourLanes to_lanes(float x) {
  asm("" : "+r"(x));
  return {x, x, x, x};
}

/// a * b + c, rounded once. Clang 14 calls the instruction fma.
inline float fma_by_wasm(float a, float b, float c) {
  return __builtin_wasm_fma_f32x4(to_lanes(a), to_lanes(b), to_lanes(c))[0];
}

/// Is it the instruction? What replaces it computes a * b + c, for f32x4.relaxed_nmadd, too.
inline bool fma_is_fused() {
  volatile float one = 1.0f; /* so that no compiler computes the rest */
  const FourLanes a = to_lanes(one);
  return __builtin_wasm_fms_f32x4(a, a, FourLanes{})[0] < 0.0f;
}

}  // namespace isowave::core

#endif
