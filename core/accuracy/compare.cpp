#include "core/accuracy/compare.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"

namespace isowave::core {
namespace {

/// Nearest rank: the smallest value that at least `percent` of all values do not exceed. Reorders
/// `values`, not empty.
double percentile(std::vector<double> &values, std::size_t percent) {
  const std::size_t rank = std::max<std::size_t>((values.size() * percent + 99) / 100, 1);
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace

DepthComparison compare_depth(const FloatImage &a, const FloatImage &b) {
  check_same_size(a, b);
  DepthComparison result;
  result.num_pixels = a.pixels.size();
  std::vector<double> errors;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const float depth_a = a.pixels[i], depth_b = b.pixels[i];
    const bool hit_a = std::isfinite(depth_a), hit_b = std::isfinite(depth_b);
    result.num_differing +=
        std::bit_cast<std::uint32_t>(depth_a) != std::bit_cast<std::uint32_t>(depth_b) ? 1 : 0;
    result.false_positives += !hit_a && hit_b ? 1 : 0;
    result.false_negatives += hit_a && !hit_b ? 1 : 0;
    if (hit_a && hit_b) errors.push_back(std::abs(double(depth_a) - double(depth_b)));
  }
  result.hit_both = errors.size();
  if (!errors.empty()) {
    result.error =
        DepthError{percentile(errors, 50), percentile(errors, 99), percentile(errors, 100)};
  }
  return result;
}

ColourComparison compare_colour(const Image8 &a, const Image8 &b) {
  check_same_size(a, b);
  if (a.channels != b.channels) {
    throw Error("the images differ in channels: {} and {}", a.channels, b.channels);
  }
  ColourComparison result;
  result.num_pixels = std::uint64_t(a.width) * a.height;
  std::uint64_t sum_of_squares = 0;
  for (std::size_t pixel = 0; pixel < result.num_pixels; ++pixel) {
    bool differs = false;
    for (std::size_t channel = 0; channel < a.channels; ++channel) {
      const std::size_t i = pixel * a.channels + channel;
      const auto difference =
          static_cast<std::uint32_t>(std::abs(int(a.pixels[i]) - int(b.pixels[i])));
      differs |= difference != 0;
      result.max_channel_difference = std::max(result.max_channel_difference, difference);
      sum_of_squares += std::uint64_t(difference) * difference;
    }
    result.num_differing += differs ? 1 : 0;
  }
  if (sum_of_squares != 0) {
    const double mean_square = double(sum_of_squares) / double(a.pixels.size());
    result.psnr_db = 10.0 * std::log10(255.0 * 255.0 / mean_square);
  }
  return result;
}

}  // namespace isowave::core
