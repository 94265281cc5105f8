// fma_by_double.h against the C library's fma(), which here is right (glibc's, or an instruction).

#include "kernels_cl/portable/fma_by_double.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

namespace isowave::core {
namespace {

void expect_same(float a, float b, float c) {
  const float expected = std::fma(a, b, c), found = fma_by_double(a, b, c);
  if (std::isnan(expected)) {
    EXPECT_TRUE(std::isnan(found)) << a << " * " << b << " + " << c;
  } else {
    ASSERT_EQ(std::bit_cast<std::uint32_t>(found), std::bit_cast<std::uint32_t>(expected))
        << std::hexfloat << a << " * " << b << " + " << c;
  }
}

TEST(FmaByDouble, IsRoundedOnce) {
  std::mt19937 random(1);
  std::uniform_int_distribution<std::uint32_t> any, small(0, 7), exponent(100, 154);
  // Few bits at either end of the significands: then sums often end near the middle between two
  // float32. Exponents around 1, so that products and addends overlap.
  const auto nasty = [&] {
    const std::uint32_t ends = small(random) << 20 | small(random);
    return std::bit_cast<float>(any(random) << 31 | exponent(random) << 23 | ends);
  };
  int num_rounded_twice = 0;
  for (int i = 0; i < 2'000'000; ++i) {
    const float a = nasty(), b = nasty(), c = nasty();
    expect_same(a, b, c);
    if (HasFatalFailure()) return;
    const auto twice = static_cast<float>(double{a} * double{b} + double{c});
    num_rounded_twice += twice != std::fma(a, b, c);
  }
  EXPECT_GT(num_rounded_twice, 50) << "no case is hard";
}

TEST(FmaByDouble, IsRoundedOnceWhereFloatsHaveFewerBits) {
  std::mt19937 random(2);
  std::uniform_int_distribution<std::uint32_t> any, small(1, 7), half(2, 50);
  int num_rounded_twice = 0;
  for (int i = 0; i < 1'000'000; ++i) {
    // (1 + e)(1 - e) of half of the least float: a little less than the middle between two.
    const std::uint32_t exponent = half(random), ends = small(random);
    const auto with_sign = [&](std::uint32_t bits) {
      return std::bit_cast<float>((any(random) & 0x80000000u) | bits);
    };
    const float a = with_sign(exponent << 23 | ends),
                b = with_sign((103 - exponent) << 23 | (0x800000u - 2 * ends)),
                c = with_sign(any(random) & 0xFFFFFFu);
    expect_same(a, b, c);
    if (HasFatalFailure()) return;
    num_rounded_twice += static_cast<float>(double{a} * double{b} + double{c}) != std::fma(a, b, c);
  }
  EXPECT_GT(num_rounded_twice, 50) << "no case is hard";
}

TEST(FmaByDouble, KeepsZerosInfinitiesAndNaN) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity(),
                  kLargest = std::numeric_limits<float>::max(),
                  kLeast = std::numeric_limits<float>::denorm_min(),
                  kNan = std::numeric_limits<float>::quiet_NaN();
  const float values[] = {0.0f,     -0.0f,     1.0f,   -1.0f,   kInfinity, -kInfinity,
                          kLargest, -kLargest, kLeast, -kLeast, kNan};
  for (const float a : values) {
    for (const float b : values) {
      for (const float c : values) expect_same(a, b, c);
    }
  }
}

}  // namespace
}  // namespace isowave::core
