#include "bench/gpu_peer/compare.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace isowave::core::bench {

void HitComparison::add(std::span<const float> side, std::span<const float> isowave) {
  for (std::size_t pixel = 0; pixel < side.size(); ++pixel) {
    const bool hits = std::isfinite(side[pixel]), should = std::isfinite(isowave[pixel]);
    if (hits && should) {
      ++counts_.hits;
      distances_.push_back(std::abs(side[pixel] - isowave[pixel]));
    } else if (should) {
      ++counts_.missed;
    } else if (hits) {
      ++counts_.false_hits;
    }
  }
}

HitDifference HitComparison::difference() const {
  HitDifference difference = counts_;
  if (distances_.empty()) return difference;
  std::vector<float> sorted = distances_;
  const auto p99 = sorted.begin() + std::ptrdiff_t(0.99 * double(sorted.size() - 1));
  std::nth_element(sorted.begin(), p99, sorted.end());
  difference.p99 = double{*p99} / voxel_;
  difference.largest = double{*std::max_element(sorted.begin(), sorted.end())} / voxel_;
  return difference;
}

double share_of_other_bytes(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) {
  std::size_t others = 0;
  for (std::size_t i = 0; i < a.size(); ++i) others += std::abs(int{a[i]} - int{b[i]}) > 2;
  return double(others) / double(std::max<std::size_t>(a.size(), 1));
}

}  // namespace isowave::core::bench
