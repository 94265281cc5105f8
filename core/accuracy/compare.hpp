#pragma once
// How two images differ: bits first, then what the difference means for a surface or for the eye.

#include <cstdint>
#include <optional>

#include "core/base/error.hpp"
#include "core/io/npy.hpp"
#include "core/io/png.hpp"

namespace isowave::core {

/// |a - b| in world units: percentiles by nearest rank (a value that occurs), and the largest.
struct DepthError {
  double p50 = 0.0, p99 = 0.0, max = 0.0;
};

/// Depth image A, taken as the truth, against B. A pixel is hit if its depth is finite.
struct DepthComparison {
  std::uint64_t num_pixels = 0;
  std::uint64_t num_differing =
      0;  ///< pixels whose 32 bits differ (NaNs and signed zeros as they lie in memory)
  std::uint64_t hit_both = 0;
  std::uint64_t false_positives = 0;  ///< hit in B only
  std::uint64_t false_negatives = 0;  ///< hit in A only: holes
  std::optional<DepthError> error;    ///< over the pixels hit in both; none when there are none
};

struct ColourComparison {
  std::uint64_t num_pixels = 0;
  std::uint64_t num_differing = 0;           ///< pixels of which any channel differs
  std::uint32_t max_channel_difference = 0;  ///< 0..255
  std::optional<double> psnr_db;  ///< over all channels, peak 255; none (infinite) when equal
};

/// Throws  Error: the images differ in size
void check_same_size(const auto &a, const auto &b) {
  if (a.width != b.width || a.height != b.height)
    throw Error("the images differ in size: {}x{} and {}x{}", a.width, a.height, b.width, b.height);
}

/// Throws  Error: the images differ in size
DepthComparison compare_depth(const FloatImage &a, const FloatImage &b);
/// Throws  Error: the images differ in size or number of channels
ColourComparison compare_colour(const Image8 &a, const Image8 &b);

}  // namespace isowave::core
