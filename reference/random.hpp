#pragma once
// Numbers that are the same with every standard library, unlike its distributions.

#include <array>
#include <cmath>
#include <cstdint>
#include <random>

namespace isowave::core {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// [0,1)
  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double in(double low, double high) { return low + (high - low) * unit(); }
  /// 0 .. end - 1
  std::uint32_t below(std::uint32_t end) { return static_cast<std::uint32_t>(engine_() % end); }

  std::array<double, 3> in_box(const std::array<double, 3> &low,
                               const std::array<double, 3> &high) {
    return {in(low[0], high[0]), in(low[1], high[1]), in(low[2], high[2])};
  }
  /// Uniform on the unit sphere.
  std::array<double, 3> direction() {
    for (;;) {
      const std::array<double, 3> v = in_box({-1, -1, -1}, {1, 1, 1});
      const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
      if (length > 0.1 && length < 1) return {v[0] / length, v[1] / length, v[2] / length};
    }
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace isowave::core
