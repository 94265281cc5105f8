// What the engine calls in a browser without a multiply-add that is rounded once (relaxed.js). Only
// the first lane is read there.

#include <emscripten.h>
#include <wasm_simd128.h>

#include "kernels_cl/portable/fma_by_double.h"

extern "C" EMSCRIPTEN_KEEPALIVE v128_t engine_fma(v128_t a, v128_t b, v128_t c) {
  const auto first = [](v128_t x) { return wasm_f32x4_extract_lane(x, 0); };
  return wasm_f32x4_splat(isowave::core::fma_by_double(first(a), first(b), first(c)));
}
