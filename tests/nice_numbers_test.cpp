// Round lengths and ticks: exact ones, and what holds of any range.

#include "core/view/nice_numbers.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace isowave::core {
namespace {

using testing::ElementsAre;

TEST(NiceNumbers, LengthsAreRoundAndExact) {
  EXPECT_EQ(round_length(1), 1);
  EXPECT_EQ(round_length(0.99), 0.5);
  EXPECT_EQ(round_length(1.99), 1);
  EXPECT_EQ(round_length(2), 2);
  EXPECT_EQ(round_length(4.99), 2);
  EXPECT_EQ(round_length(5), 5);
  EXPECT_EQ(round_length(9.99), 5);
  EXPECT_EQ(round_length(0.1), 0.1);
  EXPECT_EQ(round_length(0.3), 0.2);
  EXPECT_EQ(round_length(0.0005), 0.0005);
  EXPECT_EQ(round_length(70'000'000), 50'000'000);
  EXPECT_EQ(round_length(1e300), 1e300);
}

TEST(NiceNumbers, AnyLengthIsHardlyRounded) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> exponents(-200, 200);
  for (int i = 0; i < 20'000; ++i) {
    const double most = std::pow(10, exponents(random)), length = round_length(most);
    ASSERT_LE(length, most);
    ASSERT_GT(length * 2.5 * (1 + 1e-12), most);
    const std::string digits = fmt::format("{:.12e}", length);
    ASSERT_TRUE(digits[0] == '1' || digits[0] == '2' || digits[0] == '5') << digits;
    ASSERT_EQ(digits.find_first_not_of("0.", 1), digits.find('e')) << digits;
  }
}

TEST(NiceNumbers, TicksOfEveryDay) {
  EXPECT_THAT(ticks_between(0, 1).labels, ElementsAre("0.0", "0.5", "1.0"));
  EXPECT_THAT(ticks_between(0, 2).values, ElementsAre(0, 0.5, 1, 1.5, 2));
  EXPECT_THAT(ticks_between(0, 255).labels, ElementsAre("0", "100", "200"));
  EXPECT_THAT(ticks_between(255, 0).labels, ElementsAre("0", "100", "200"));
  EXPECT_THAT(ticks_between(-1, 1).labels, ElementsAre("-1.0", "-0.5", "0.0", "0.5", "1.0"));
  EXPECT_THAT(ticks_between(0.1, 0.3).labels, ElementsAre("0.10", "0.15", "0.20", "0.25", "0.30"));
  EXPECT_THAT(ticks_between(1e9, 3e9).labels,
              ElementsAre("1e+09", "1.5e+09", "2e+09", "2.5e+09", "3e+09"));
  EXPECT_THAT(ticks_between(-1e7, 1e7).labels,
              ElementsAre("-1e+07", "-5e+06", "0", "5e+06", "1e+07"));
  EXPECT_THAT(ticks_between(7, 7).labels, ElementsAre("7"));
}

TEST(NiceNumbers, AnyRangeHasThreeToFiveTicksThatLabelsTellApart) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> exponents(-30, 30), parts(-1, 1);
  for (int i = 0; i < 20'000; ++i) {
    const double scale = std::pow(10, exponents(random)), low = scale * parts(random),
                 high = low + scale * std::abs(parts(random)) + scale * 1e-6;
    const Ticks ticks = ticks_between(low, high);
    SCOPED_TRACE(fmt::format("{} to {}: {}", low, high, fmt::join(ticks.labels, ", ")));
    ASSERT_GE(ticks.values.size(), 3u);
    ASSERT_LE(ticks.values.size(), 5u);
    ASSERT_EQ(ticks.labels.size(), ticks.values.size());
    const double step = ticks.values[1] - ticks.values[0];
    for (std::size_t at = 0; at < ticks.values.size(); ++at) {
      ASSERT_GE(ticks.values[at], low);
      ASSERT_LE(ticks.values[at], high);
      ASSERT_NEAR(ticks.values[at], ticks.values[0] + double(at) * step, 1e-6 * step);
      ASSERT_NEAR(std::stod(ticks.labels[at]), ticks.values[at], 1e-6 * step);
    }
    // A further one would be outside.
    ASSERT_LT(ticks.values.front() - step, low);
    ASSERT_GT(ticks.values.back() + step, high);
  }
}

TEST(NiceNumbers, NeighboursInFloatHaveTicks) {
  const double next = std::nextafter(1e6, 2e6);
  const Ticks ticks = ticks_between(1e6, next);
  EXPECT_THAT(ticks.values, ElementsAre(1e6, next));
  EXPECT_NE(ticks.labels[0], ticks.labels[1]);
  constexpr double kMost = std::numeric_limits<double>::max() / 4;
  EXPECT_GE(ticks_between(-kMost, kMost).values.size(), 3u);
}

}  // namespace
}  // namespace isowave::core
