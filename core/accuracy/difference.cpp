#include "core/accuracy/difference.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/accuracy/compare.hpp"
#include "core/accuracy/flip.hpp"
#include "core/view/color_maps.hpp"

namespace isowave::core {

namespace {

constexpr std::uint32_t kOnlyA = 0x009fe6, kOnlyB = 0, kNeither = 0xffffff;  ///< as color_map()

/// The colour of a value from 0 to 1.
std::uint32_t mapped_color(const std::array<std::uint32_t, 256> &map, double value) {
  return map.at(static_cast<std::size_t>(std::lround(255 * std::clamp(value, 0.0, 1.0))));
}

void put_color(Image8 &picture, std::uint32_t color) {
  for (const unsigned shift : {0u, 8u, 16u})
    picture.pixels.push_back(static_cast<std::uint8_t>(color >> shift));
}

}  // namespace

DepthDifference depth_difference(const FloatImage &a, const FloatImage &b) {
  const std::optional<DepthError> error = compare_depth(a, b).error;
  DepthDifference result{.picture = {a.width, a.height, 3, {}}};
  if (error) result.full = error->p99 > 0 ? error->p99 : error->max;
  const auto map = color_map("coolwarm");
  result.picture.pixels.reserve(3 * a.pixels.size());
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const bool in_a = std::isfinite(a.pixels[i]), in_b = std::isfinite(b.pixels[i]);
    const double farther = in_a && in_b ? double(b.pixels[i]) - double(a.pixels[i]) : 0;
    const double part = farther == 0 ? 0 : farther / result.full;
    put_color(result.picture, in_a && in_b ? mapped_color(map, 0.5 + 0.5 * part)
                              : in_a       ? kOnlyA
                              : in_b       ? kOnlyB
                                           : kNeither);
  }
  return result;
}

Image8 picture_difference(const Image8 &a, const Image8 &b) {
  const std::vector<double> errors = Flip(a).errors(b);
  const auto map = color_map("magma");
  Image8 picture{a.width, a.height, 3, {}};
  picture.pixels.reserve(3 * errors.size());
  for (const double error : errors) put_color(picture, mapped_color(map, error));
  return picture;
}

}  // namespace isowave::core
