#include "core/view/nice_numbers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace isowave::core {

namespace {

constexpr std::size_t kLeast = 3, kMost = 5;
/// Between ends that a step should have met, rounding leaves at most this share of it.
constexpr double kRounding = 1e-9;
/// The smallest range that has ticks, as a share of its larger end.
constexpr double kLeastRange = 1e-11;

/// tenths / 10 * 10^exponent, rounded once for the exponents of every day.
double scaled(double tenths, int exponent) {
  const int up = exponent - 1;
  return up < 0 ? tenths / std::pow(10.0, -up) : tenths * std::pow(10.0, up);
}

int exponent_of(double value) {
  return static_cast<int>(std::floor(std::log10(value)));
}

struct Multiples {
  double first = 0, last = 0;  ///< whole numbers of steps
  double count() const { return last - first + 1; }
};

Multiples multiples_between(double low, double high, double step) {
  return {std::ceil(low / step - kRounding), std::floor(high / step + kRounding)};
}

/// Decimals that a multiple of tenths / 10 * 10^exponent needs.
int decimals_of(int tenths, int exponent) {
  return std::max(0, (tenths % 10 == 0 ? 0 : 1) - exponent);
}

std::string label_of(double value, double largest, int tenths, int exponent) {
  if (largest < 1e6 && exponent >= -5)
    return fmt::format("{:.{}f}", value, decimals_of(tenths, exponent));
  const int digits = exponent_of(largest) - exponent + (tenths % 10 == 0 ? 1 : 2);
  return fmt::format("{:.{}g}", value, std::clamp(digits, 1, 17));
}

}  // namespace

double round_length(double most) {
  const int exponent = exponent_of(most);
  for (int at = exponent + 1; at >= exponent - 1; --at) {
    for (const int tenths : {50, 20, 10}) {
      if (scaled(tenths, at) <= most) return scaled(tenths, at);
    }
  }
  return most;  // a denormal
}

Ticks ticks_between(double low, double high) {
  if (low > high) std::swap(low, high);
  const double range = high - low;
  if (!(range > 0) || !std::isfinite(1 / range)) return {{low}, {fmt::format("{:.6g}", low)}};
  const double largest = std::max(std::abs(low), std::abs(high));
  // Beyond, multiples of a step are no whole numbers that a double tells apart.
  if (range < kLeastRange * largest)
    return {{low, high}, {fmt::format("{:.17g}", low), fmt::format("{:.17g}", high)}};
  const int exponent = exponent_of(range);
  // From one to the next it is a factor of at most 5/3, so some step has 3 to 5 multiples; the
  // usual ones come first, the finest of them.
  for (const auto &choices : {std::vector{10, 20, 50}, std::vector{15, 25, 40, 75}}) {
    for (int at = exponent - 1; at <= exponent; ++at) {
      for (const int tenths : choices) {
        const Multiples found = multiples_between(low, high, scaled(tenths, at));
        if (found.count() < kLeast || found.count() > kMost) continue;
        Ticks ticks;
        for (double i = found.first; i <= found.last; ++i) {
          const double value = std::clamp(scaled(i * tenths, at), low, high);
          ticks.values.push_back(value == 0 ? 0.0 : value);  // never -0
          ticks.labels.push_back(label_of(ticks.values.back(), largest, tenths, at));
        }
        return ticks;
      }
    }
  }
  throw std::logic_error("no round step has 3 to 5 multiples");
}

}  // namespace isowave::core
