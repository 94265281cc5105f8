#include "core/accuracy/pixels_to_refine.hpp"

#include <algorithm>
#include <cstdlib>

namespace isowave::core {

namespace {

/// Whether two pixels [3] differ.
bool differ(const std::uint8_t *a, const std::uint8_t *b) {
  int largest = 0;
  for (int channel = 0; channel < 3; ++channel)
    largest = std::max(largest, std::abs(int{a[channel]} - int{b[channel]}));
  return largest > kLargestDifference;
}

}  // namespace

std::vector<std::uint32_t> pixels_to_refine(ImageSize size, std::span<const std::uint8_t> rgb) {
  const std::uint32_t width = size.width, height = size.height;
  std::vector<std::uint8_t> is_refined(size.num_pixels());
  const auto compare = [&](std::uint32_t a, std::uint32_t b) {
    if (!differ(&rgb[std::size_t{3} * a], &rgb[std::size_t{3} * b])) return;
    is_refined[a] = is_refined[b] = 1;
  };
  // Each pair once: with the neighbour on the right, and the three below.
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const std::uint32_t pixel = y * width + x;
      const bool has_right = x + 1 < width;
      if (has_right) compare(pixel, pixel + 1);
      if (y + 1 == height) continue;
      if (x > 0) compare(pixel, pixel + width - 1);
      compare(pixel, pixel + width);
      if (has_right) compare(pixel, pixel + width + 1);
    }
  }
  std::vector<std::uint32_t> pixels;
  for (std::uint32_t pixel = 0; pixel < is_refined.size(); ++pixel) {
    if (is_refined[pixel] != 0) pixels.push_back(pixel);
  }
  return pixels;
}

}  // namespace isowave::core
