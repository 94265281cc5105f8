#pragma once
// The values through which the value ranges of blocks are stored in 8 bits: a range is rounded
// outward to them (kernels_cl/macrocells.cl).

#include <cstdint>
#include <vector>

namespace isowave::core {

inline constexpr std::uint32_t kNumThresholds = 256;

/// The blocks of which the thresholds are made: sampled_block(i * stride, stride), i in [0, count).
struct RangeSample {
  std::uint32_t stride, count;
};
RangeSample range_sample(std::uint64_t num_blocks);

/// Half of them quantiles, so that one outlier does not coarsen the rest; half at even distances,
/// so that the noise of a plateau, which has most of the values, does not either.
///
/// values   the smallest and the largest voxel of each sampled block
/// Returns  [kNumThresholds], ascending from -inf to +inf
std::vector<float> range_thresholds(std::vector<float> values);

/// The first threshold that is >= value; kNumThresholds if there is none.
std::uint32_t threshold_index(const std::vector<float> &thresholds, double value);

}  // namespace isowave::core
