#pragma once
// Eight float32 or int32 at a time: what kernels_cl/portable/packet.h needs, as
// kernels_cl/device/float8.h has it for OpenCL. For files that are compiled for one kind of
// processor, and define before
//
//   ISO_PACKET_NAMESPACE  in which all of it is, since each kind has functions of its own
//   ISO_PACKET_SSE4       on x86-64, for registers of four, without fused multiply-add; elsewhere,
//                         AVX2 and fused multiply-add

#ifdef __x86_64__
#include <immintrin.h>
#endif

#include <bit>
#include <cstdint>

#include "kernels_cl/portable/shared_types.h"

#define ISO_PACKET_NAMESPACE_BEGIN namespace isowave::core::ISO_PACKET_NAMESPACE {
#define ISO_PACKET_NAMESPACE_END }
#define ISO_UNLIKELY(condition) __builtin_expect(condition, 0)
/// A function that is called so rarely, or so seldom, that it must not burden its callers.
#define ISO_RARE [[maybe_unused]] static __attribute__((noinline, cold))
#define ISO_SELDOM [[maybe_unused]] static __attribute__((noinline))
// NOLINTBEGIN(bugprone-macro-parentheses): names of variables
/// A loop over 0, 1, 2, unrolled: compilers leave those with long bodies as they are.
#if defined(__clang__)
#define ISO_EACH_OF_3(i) _Pragma("unroll") for (int i = 0; i < 3; ++i)
#else
#define ISO_EACH_OF_3(i) _Pragma("GCC unroll 3") for (int i = 0; i < 3; ++i)
#endif
/// A loop over the lanes of a mask.
#define ISO_EACH_LANE(lane, mask)                                                              \
  for (unsigned left_##lane = bits_of(mask), lane = first_lane(left_##lane); left_##lane != 0; \
       left_##lane &= left_##lane - 1, lane = first_lane(left_##lane))
// NOLINTEND(bugprone-macro-parentheses)

namespace isowave::core::ISO_PACKET_NAMESPACE {

inline unsigned first_lane(unsigned bits) {
  return static_cast<unsigned>(std::countr_zero(bits));
}

}  // namespace isowave::core::ISO_PACKET_NAMESPACE

#if defined(__wasm__)
#include "core/host/float8_wasm.hpp"
#elif defined(ISO_PACKET_SSE4)
#include "core/host/float8_sse4.hpp"
#else
#include "core/host/float8_avx2.hpp"
#endif
