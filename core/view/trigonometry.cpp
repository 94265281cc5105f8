#include "core/view/trigonometry.hpp"

#include <cmath>
#include <utility>

namespace isowave::core {

namespace {

/// A number of about 105 bits: the sum of two doubles, of which `low` is at most half a bit of
/// `high`.
struct Twofold {
  double high = 0, low = 0;
};

/// The exact sum of two doubles (Knuth).
Twofold exact_sum(double a, double b) {
  const double sum = a + b, of_b = sum - a;
  return {sum, (a - (sum - of_b)) + (b - of_b)};
}

/// Halves of a double, of 26 bits each (Veltkamp).
Twofold halves_of(double a) {
  const double spread = 134217729 * a, high = spread - (spread - a);  // 2^27 + 1
  return {high, a - high};
}

/// The exact product of two doubles (Dekker). std::fma() would do, but not on every system.
Twofold exact_product(double a, double b) {
  const double product = a * b;
  const Twofold x = halves_of(a), y = halves_of(b);
  return {product, ((x.high * y.high - product) + x.high * y.low + x.low * y.high) + x.low * y.low};
}

Twofold operator+(const Twofold &a, const Twofold &b) {
  const Twofold high = exact_sum(a.high, b.high), low = exact_sum(a.low, b.low);
  const Twofold more = exact_sum(high.high, high.low + low.high);
  return exact_sum(more.high, more.low + low.low);
}

Twofold operator-(const Twofold &a) {
  return {-a.high, -a.low};
}

Twofold operator*(const Twofold &a, const Twofold &b) {
  const Twofold product = exact_product(a.high, b.high);
  return exact_sum(product.high, product.low + (a.high * b.low + a.low * b.high));
}

Twofold operator/(const Twofold &a, const Twofold &b) {
  const double first = a.high / b.high;
  const Twofold left = a + -(b * Twofold{first});
  const double second = left.high / b.high;
  const Twofold rest = left + -(b * Twofold{second});
  return exact_sum(first, second) + Twofold{rest.high / b.high};
}

struct SineAndCosine {
  Twofold sine, cosine;
};

/// Taylor's series at an angle of at most about pi/4. What is left out is below 2^-104.
SineAndCosine series_at(const Twofold &angle) {
  const Twofold square = angle * angle;
  Twofold sine_term = angle, cosine_term{1}, sine{}, cosine{};
  for (int n = 0; n < 28; n += 2) {
    sine = sine + sine_term;
    cosine = cosine + cosine_term;
    cosine_term = -(cosine_term * square) / Twofold{double((n + 1) * (n + 2))};
    sine_term = -(sine_term * square) / Twofold{double((n + 2) * (n + 3))};
  }
  return {sine, cosine};
}

/// angle  at most kLargest, either sign
SineAndCosine sine_and_cosine(double angle) {
  // pi/2 in three doubles. Each product with a number of turns is exact.
  constexpr double kQuarter = 0x1.921fb54442d18p+0, kSecond = 0x1.1a62633145c07p-54,
                   kThird = -0x1.f1976b7ed8fbcp-110;
  const double quarters = std::nearbyint(angle / kQuarter);
  const Twofold rest = Twofold{angle} + -exact_product(quarters, kQuarter) +
                       -exact_product(quarters, kSecond) + -exact_product(quarters, kThird);
  const auto [sine, cosine] = series_at(rest);
  switch (static_cast<long long>(quarters) & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

constexpr double kLargest = 1e9;

bool is_series_for(double angle) {
  return std::abs(angle) <= kLargest;
}

}  // namespace

double sine(double angle) {
  if (!is_series_for(angle)) return std::sin(angle);
  return std::abs(angle) < 1e-9 ? angle : sine_and_cosine(angle).sine.high;  // also -0
}

double cosine(double angle) {
  return is_series_for(angle) ? sine_and_cosine(angle).cosine.high : std::cos(angle);
}

double tangent(double angle) {
  if (!is_series_for(angle)) return std::tan(angle);
  if (std::abs(angle) < 1e-9) return angle;
  const auto [sine, cosine] = sine_and_cosine(angle);
  return (sine / cosine).high;
}

// One step of Newton's method from the C library's value, whose error it takes to the third power:
// what the C library's last bit is then does not matter.
double arc_tangent(double value) {
  const double near = std::atan(value);
  if (!(std::abs(value) > 1e-9 && std::abs(value) < 1e9)) return near;
  const auto [sine, cosine] = sine_and_cosine(near);
  const Twofold tangent{value};
  return (Twofold{near} + (tangent * cosine + -sine) / (cosine + tangent * sine)).high;
}

}  // namespace isowave::core
