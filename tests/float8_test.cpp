// core/host/float8_sse4.hpp: what processors without fused multiply-add compute instead, against
// that of the C library, and the functions that are taken from smaller registers.

#include <gtest/gtest.h>

#ifdef __x86_64__
#include <immintrin.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include "kernels_cl/portable/shared_types.h"

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("sse4.1,popcnt"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("sse4.1,popcnt")
#endif
#define ISO_PACKET_NAMESPACE packets_of_test
#define ISO_PACKET_SSE4
#include "core/host/float8.hpp"

namespace isowave::core {
namespace {

using packets_of_test::Floats;

std::uint32_t bits_of_float(float x) {
  return std::isnan(x) ? 0x7FC00000u : std::bit_cast<std::uint32_t>(x);
}

/// Eight numbers at a time, of which one differs.
void expect_fma(float a, float b, float c) {
  Floats as = packets_of_test::floats(1.5f), bs = as, cs = as;
  static int lane = 0;
  lane = (lane + 1) % 8;
  as[lane] = a;
  bs[lane] = b;
  cs[lane] = c;
  const Floats result = packets_of_test::fma(as, bs, cs);
  for (int i = 0; i < 8; ++i) {
    const float expected = std::fma(as[i], bs[i], cs[i]);
    ASSERT_EQ(bits_of_float(result[i]), bits_of_float(expected))
        << as[i] << " * " << bs[i] << " + " << cs[i] << ", lane " << i;
  }
}

TEST(Float8, FmaIsRoundedOnce) {
  if (!__builtin_cpu_supports("sse4.1")) GTEST_SKIP() << "needs SSE4.1";
  std::mt19937 random(5);
  const auto any_bits = [&] { return std::bit_cast<float>(static_cast<std::uint32_t>(random())); };
  for (int i = 0; i < 100000; ++i) {
    expect_fma(any_bits(), any_bits(), any_bits());
    // The sum nearly halfway between two float32, or nearly nothing.
    const auto small = [&] {
      return std::ldexp(1.0f + static_cast<float>(random() % 64) * 0x1p-23f,
                        static_cast<int>(random() % 3));
    };
    const float a = small(), b = small(), product = a * b;
    expect_fma(a, b, -product);
    expect_fma(a, -b, product);
    expect_fma(a, b, std::ldexp(small(), static_cast<int>(random() % 60) - 30));
    expect_fma(a, b, -std::ldexp(small(), static_cast<int>(random() % 60) - 30));
    // Results that are denormal.
    const float tiny = std::ldexp(small(), -127 - static_cast<int>(random() % 20));
    expect_fma(tiny, small(), std::ldexp(small(), -140));
    expect_fma(std::ldexp(small(), -70), std::ldexp(small(), -70), tiny);
    if (HasFatalFailure()) return;
  }
  const float inf = std::numeric_limits<float>::infinity();
  for (const float a :
       {0.0f, -0.0f, 1.0f, -3.0f, inf, -inf, std::nanf(""), 0x1p-149f, 0x1.fffffep127f}) {
    for (const float b : {0.0f, -0.0f, 1.0f, -3.0f, inf, 0x1p-149f, 0x1.fffffep127f}) {
      for (const float c : {0.0f, -0.0f, 1.0f, 3.0f, inf, -inf, -0x1p-149f, 0x1.fffffep127f})
        expect_fma(a, b, c);
    }
  }
}

TEST(Float8, RoundsLikeTheLibrary) {
  if (!__builtin_cpu_supports("sse4.1")) GTEST_SKIP() << "needs SSE4.1";
  const Floats x = {-2.5f, -1.5f, -0.5f, 0.5f, 1.5f, 2.5f, 3.25f, -3.75f};
  const Floats floors = packets_of_test::floor(x), nearest = packets_of_test::to_nearest(x),
               roots = packets_of_test::sqrt(x * x);
  const auto is_small = x < 1.0f;
  const Floats picked = packets_of_test::pick(is_small, x, -x);
  unsigned small_lanes = 0;
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(floors[i], std::floor(x[i]));
    EXPECT_EQ(nearest[i], std::rint(x[i]));
    EXPECT_EQ(roots[i], std::abs(x[i]));
    EXPECT_EQ(picked[i], x[i] < 1 ? x[i] : -x[i]);
    small_lanes |= (x[i] < 1 ? 1u : 0u) << i;
  }
  EXPECT_EQ(packets_of_test::bits_of(is_small), small_lanes);
}

}  // namespace
}  // namespace isowave::core
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif
