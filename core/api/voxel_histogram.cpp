#include "core/api/voxel_histogram.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/volume/volume.hpp"

namespace isowave {

namespace {

/// Voxels that the histogram is made of, about.
constexpr std::uint64_t kSampledVoxels = 1u << 21;
constexpr double kMostBins = 256;

std::size_t bins_of(const Volume &volume, const std::array<float, 2> &range) {
  const double values = double{range[1]} - double{range[0]} + 1;
  if (!core::is_integer(static_cast<core::VoxelType>(volume.source_type())) || values <= 1)
    return static_cast<std::size_t>(kMostBins);
  return static_cast<std::size_t>(std::ceil(values / std::ceil(values / kMostBins)));
}

}  // namespace

std::array<float, 2> range_or_sampled(const Volume &volume) {
  std::array<float, 2> range = volume.value_range();
  if (std::isfinite(range[0]) && std::isfinite(range[1])) return range;
  range = {std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  for (const float voxel : volume.sample(kSampledVoxels)) {
    if (!std::isfinite(voxel)) continue;
    range = {std::min(range[0], voxel), std::max(range[1], voxel)};
  }
  return range[0] <= range[1] ? range : std::array{0.0f, 0.0f};
}

VoxelHistogram voxel_histogram(const Volume &volume) {
  VoxelHistogram result{{}, range_or_sampled(volume), volume.suggested_isovalues()};
  const auto [low, high] = result.range;
  const std::size_t bins = bins_of(volume, result.range);
  result.counts.resize(bins);
  const double width = high > low ? double{high} - double{low} : 1;
  for (const float voxel : volume.sample(kSampledVoxels)) {
    const double bin = std::floor((double{voxel} - low) * double(bins) / width);
    if (std::isfinite(bin))
      ++result.counts[static_cast<std::size_t>(std::clamp(bin, 0.0, double(bins - 1)))];
  }
  return result;
}

}  // namespace isowave
