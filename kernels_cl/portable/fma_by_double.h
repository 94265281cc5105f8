/// fma_by_double.h -- fma() of float32 by float64, for C libraries whose own rounds twice: musl's,
/// which WebAssembly has, and mingw-w64's. C++ alone.
///
/// The product of two float32 is exact in float64. If the sum is rounded to float64 and then to
/// float32, the second rounding is wrong only if the first one has come to the middle between two
/// float32. There, the first one rounds to odd instead [Boldo, Melquiond: Emulation of a FMA and
/// Correctly Rounded Sums, 2008].
#ifndef ISOWAVE_FMA_BY_DOUBLE_H
#define ISOWAVE_FMA_BY_DOUBLE_H

#include <bit>
#include <cmath>
#include <cstdint>

#ifdef __wasm_relaxed_simd__
#include "fma_by_wasm.h"
#endif

namespace isowave::core {

/// product + addend, rounded to odd: of the two neighbours of an inexact sum, the one whose last
/// bit is 1.
///
/// sum  product + addend, rounded to nearest
[[gnu::noinline]] inline double sum_to_odd(double product, double addend, double sum) {
  const double of_addend = sum - product,
               error = (product - (sum - of_addend)) + (addend - of_addend);
  const auto bits = std::bit_cast<std::uint64_t>(sum);
  if (error == 0.0 || (bits & 1u) != 0) return sum;
  return std::bit_cast<double>((error > 0.0) == (sum > 0.0) ? bits + 1 : bits - 1);
}

/// a * b + c, rounded once. Modules for browsers with an instruction call that.
inline float fma_by_double(float a, float b, float c) {
#ifdef __wasm_relaxed_simd__
  return fma_by_wasm(a, b, c);
#else
  constexpr std::uint64_t kLeftOut = (std::uint64_t{1} << 29) - 1,  // bits that float32 has not
      kMiddle = std::uint64_t{1} << 28;
  const double product = static_cast<double>(a) * b, sum = product + c;
  const bool is_middle = (std::bit_cast<std::uint64_t>(sum) & kLeftOut) == kMiddle,
             has_fewer_bits = std::fabs(sum) < 0x1p-125 && sum != 0.0;
  if (is_middle || has_fewer_bits) [[unlikely]]
    return static_cast<float>(sum_to_odd(product, c, sum));
  return static_cast<float>(sum);
#endif
}

}  // namespace isowave::core

#endif
