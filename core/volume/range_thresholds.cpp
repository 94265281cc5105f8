#include "core/volume/range_thresholds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace isowave::core {

RangeSample range_sample(std::uint64_t num_blocks) {
  constexpr std::uint32_t kMaxSamples = 1u << 14;
  const std::uint64_t stride = (num_blocks + kMaxSamples - 1) / kMaxSamples;
  return {static_cast<std::uint32_t>(stride), static_cast<std::uint32_t>(num_blocks / stride)};
}

std::vector<float> range_thresholds(std::vector<float> values) {
  std::erase_if(values, [](float value) { return !std::isfinite(value); });  // of no voxels
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());

  std::vector<float> thresholds(kNumThresholds, std::numeric_limits<float>::infinity());
  thresholds[0] = -std::numeric_limits<float>::infinity();
  if (values.size() <= kNumThresholds - 2) {
    std::ranges::copy(values, thresholds.begin() + 1);
    return thresholds;
  }
  constexpr std::size_t kNumQuantiles = kNumThresholds / 2,
                        kNumEven = kNumThresholds - 2 - kNumQuantiles;
  for (std::size_t i = 0; i < kNumQuantiles;
       ++i) {  // the smallest and the largest are always among them
    thresholds[1 + i] = values[i * (values.size() - 1) / (kNumQuantiles - 1)];
  }
  const std::size_t outliers = values.size() / 100;
  for (std::size_t i = 0; i < kNumEven; ++i) {
    const float part = (static_cast<float>(i) + 0.5f) / kNumEven;
    thresholds[1 + kNumQuantiles + i] =
        (1 - part) * values[outliers] + part * values[values.size() - 1 - outliers];
  }
  std::ranges::sort(thresholds);
  return thresholds;
}

std::uint32_t threshold_index(const std::vector<float> &thresholds, double value) {
  return static_cast<std::uint32_t>(std::ranges::lower_bound(thresholds, value) -
                                    thresholds.begin());
}

}  // namespace isowave::core
