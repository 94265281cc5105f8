// FLIP against what its authors' program says.

#include "core/accuracy/flip.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>

#include "core/base/error.hpp"

namespace isowave::core {
namespace {

using Rgb = std::array<int, 3>;

Image8 image_of(const std::function<Rgb(int x, int y)> &color, std::uint32_t channels = 3) {
  Image8 image{96, 64, channels, {}};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 96; ++x) {
      for (const int value : color(x, y)) image.pixels.push_back(static_cast<std::uint8_t>(value));
      if (channels == 4) image.pixels.push_back(static_cast<std::uint8_t>(x));
    }
  }
  return image;
}

Rgb stripes(int x, int y) {
  return {(5 * x + 3 * y) % 256, (x / 8 + y / 8) % 2 * 200 + 20, x * y % 256};
}

/// Means by flip-evaluator 1.7 (PyPI), which computes in float32, at its own and at 30 pixels per
/// degree.
TEST(Flip, IsWhatItsAuthorsProgramSays) {
  struct Case {
    const char *name;
    std::function<Rgb(int, int)> color;
    double mean, mean_at_30;
  };
  const std::array cases{
      Case{"shifted", [](int x, int y) { return stripes(std::max(x - 1, 0), y); }, 0.3573164,
           0.4245500},
      Case{"inverted",
           [](int x, int y) {
             const Rgb c = stripes(x, y);
             return Rgb{255 - c[0], 255 - c[1], 255 - c[2]};
           },
           0.9157528, 0.9741390},
      Case{"redder",
           [](int x, int y) {
             const Rgb c = stripes(x, y);
             return Rgb{std::min(c[0] + 16, 255), c[1], c[2]};
           },
           0.1695773, 0.1612569},
      Case{"grey",
           [](int x, int y) {
             const int green = stripes(x, y)[1];
             return Rgb{green, green, green};
           },
           0.6867793, 0.7864599},
      Case{"white",
           [](int, int) {
             return Rgb{255, 255, 255};
           },
           0.9374669, 0.9490104}};
  const Image8 reference = image_of(stripes);
  const Flip flip(reference), nearer(reference, 30);
  for (const Case &each : cases) {
    EXPECT_NEAR(flip.error(image_of(each.color)), each.mean, 1e-4) << each.name;
    EXPECT_NEAR(nearer.error(image_of(each.color)), each.mean_at_30, 1e-4) << each.name;
    EXPECT_NEAR(Flip(image_of(each.color)).error(reference), each.mean, 1e-4)
        << each.name << ", the other way";
  }
}

TEST(Flip, NothingIsDifferent) {
  EXPECT_EQ(Flip(image_of(stripes)).error(image_of(stripes)), 0.0);
  EXPECT_EQ(Flip(image_of(stripes)).error(image_of(stripes, 4)), 0.0)
      << "a fourth channel is left out";
  EXPECT_EQ(Flip(Image8{1, 1, 3, {1, 2, 3}}).error({1, 1, 3, {1, 2, 3}}), 0.0);
}

TEST(Flip, SizesMustAgree) {
  EXPECT_THROW(Flip(image_of(stripes)).error({1, 1, 3, {1, 2, 3}}), Error);
}

}  // namespace
}  // namespace isowave::core
