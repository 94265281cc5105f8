/// fma_by_wasm.h -- fma() of float32 by WebAssembly's f32x4.relaxed_madd, for modules that only run
/// where it is fused, or is replaced (tools/page/relaxed.py). C++ alone.
#ifndef ISOWAVE_FMA_BY_WASM_H
#define ISOWAVE_FMA_BY_WASM_H

namespace isowave::core {

/// a * b + c, rounded once. Clang 14 calls the instruction fma.
inline float fma_by_wasm(float a, float b, float c) {
  using Four = float __attribute__((vector_size(16)));
  return __builtin_wasm_fma_f32x4(Four{a, a, a, a}, Four{b, b, b, b}, Four{c, c, c, c})[0];
}

/// Is it the instruction? What replaces it computes a * b + c, for f32x4.relaxed_nmadd, too.
inline bool fma_is_fused() {
  using Four = float __attribute__((vector_size(16)));
  volatile float one = 1.0f; /* so that no compiler computes the rest */
  const float a = one;
  return __builtin_wasm_fms_f32x4(Four{a, a, a, a}, Four{a, a, a, a}, Four{})[0] < 0.0f;
}

}  // namespace isowave::core

#endif
