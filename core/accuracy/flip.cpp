#include "core/accuracy/flip.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/glm.hpp>
#include <numbers>
#include <numeric>
#include <span>
#include <vector>

#include "core/accuracy/compare.hpp"
#include "core/base/parallel_for.hpp"

namespace isowave::core {

namespace {

/// One number a pixel [height * width].
struct Plane {
  std::uint32_t width, height;
  std::vector<double> values;
};
/// Three: of a colour.
using Planes = std::array<Plane, 3>;

/// Weights at -radius .. radius.
using Weights = std::vector<double>;

Weights sampled(int radius, const std::function<double(double)> &weight) {
  Weights kernel;
  for (int i = -radius; i <= radius; ++i) kernel.push_back(weight(i));
  return kernel;
}

/// Weights above and below 0 sum up to 1 and -1.
Weights normalized(Weights kernel) {
  double above = 0, below = 0;
  for (const double weight : kernel) (weight > 0 ? above : below) += weight;
  for (double &weight : kernel) weight /= weight > 0 ? above : -below;
  return kernel;
}

/// Along rows with some weights, then along columns with others; beyond its borders the picture
/// goes on as at them.
Plane filtered(const Plane &in, const Weights &along_x, const Weights &along_y) {
  const std::size_t width = in.width;
  Plane rows{in.width, in.height, std::vector<double>(in.values.size(), 0.0)}, result = rows;
  parallel_for(in.height, 0, [&](std::uint64_t y, std::uint32_t) {
    const std::size_t radius = along_x.size() / 2;
    const double *row = &in.values[y * width];
    double *to = &rows.values[y * width];
    std::vector<double> padded(width + 2 * radius, row[width - 1]);
    std::fill_n(padded.begin(), radius, row[0]);
    std::copy_n(row, width, padded.begin() + std::ptrdiff_t(radius));
    for (std::size_t i = 0; i < along_x.size(); ++i) {
      for (std::size_t x = 0; x < width; ++x) to[x] += along_x[i] * padded[x + i];
    }
  });
  parallel_for(in.height, 0, [&](std::uint64_t y, std::uint32_t) {
    double *to = &result.values[y * width];
    for (std::size_t i = 0; i < along_y.size(); ++i) {
      const std::int64_t at = std::int64_t(y + i) - std::int64_t(along_y.size() / 2);
      const auto clamped =
          std::size_t(std::clamp(at, std::int64_t{0}, std::int64_t{in.height} - 1));
      const double *from = &rows.values[clamped * width];
      for (std::size_t x = 0; x < width; ++x) to[x] += along_y[i] * from[x];
    }
  });
  return result;
}

// ---- colours

/// sRGB's primaries, by columns, and its white (IEC 61966-2-1).
const glm::dmat3 kRgbToXyz(0.41238656, 0.21263682, 0.01933062, 0.35759149, 0.71518298, 0.11919716,
                           0.18045049, 0.0721802, 0.95037259);
const glm::dmat3 kXyzToRgb = glm::inverse(kRgbToXyz);
const glm::dvec3 kWhite = kRgbToXyz * glm::dvec3(1);

double linear_of_srgb(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

/// The opponent space YCxCz of linear RGB, and back.
glm::dvec3 opponent_of_rgb(const glm::dvec3 &rgb) {
  const glm::dvec3 xyz = kRgbToXyz * rgb / kWhite;
  return {116 * xyz.y - 16, 500 * (xyz.x - xyz.y), 200 * (xyz.y - xyz.z)};
}
glm::dvec3 rgb_of_opponent(const glm::dvec3 &opponent) {
  const double y = (opponent.x + 16) / 116;
  return kXyzToRgb * (kWhite * glm::dvec3(y + opponent.y / 500, y, y - opponent.z / 200));
}

/// CIELAB, a and b scaled for Hunt's effect: colours look paler in the dark.
glm::dvec3 hunt_lab_of_rgb(const glm::dvec3 &rgb) {
  constexpr double kDelta = 6.0 / 29;
  const auto root = [](double t) {
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29;
  };
  const glm::dvec3 xyz = kRgbToXyz * rgb / kWhite;
  const double lightness = 116 * root(xyz.y) - 16;
  return {lightness, 0.01 * lightness * 500 * (root(xyz.x) - root(xyz.y)),
          0.01 * lightness * 200 * (root(xyz.y) - root(xyz.z))};
}

/// Distance of two colours.
double hyab(const glm::dvec3 &a, const glm::dvec3 &b) {
  return std::abs(a.x - b.x) + glm::length(glm::dvec2(a.y - b.y, a.z - b.z));
}

Planes opponent_planes(const Image8 &image) {
  std::array<double, 256> linear{};
  for (std::size_t i = 0; i < linear.size(); ++i) linear[i] = linear_of_srgb(double(i) / 255.0);
  Planes planes;
  for (Plane &plane : planes) plane = {image.width, image.height, {}};
  for (std::size_t i = 0; i < image.pixels.size(); i += image.channels) {
    const std::uint8_t *rgb = &image.pixels[i];
    const glm::dvec3 color = opponent_of_rgb({linear[rgb[0]], linear[rgb[1]], linear[rgb[2]]});
    for (int c = 0; c < 3; ++c) planes[std::size_t(c)].values.push_back(color[c]);
  }
  return planes;
}

// ---- the two parts of the error

/// The part of each channel of YCxCz that the eye resolves, by sums of Gaussians (table 1 of the
/// paper), as colours for hyab().
std::vector<glm::dvec3> as_seen(const Planes &picture, double pixels_per_degree) {
  struct Gaussian {
    double a, b;
  };
  static const std::array<std::vector<Gaussian>, 3> kSensitivity{
      {{{1, 0.0047}}, {{1, 0.0053}}, {{34.1, 0.04}, {13.5, 0.025}}}};
  constexpr double kPi = std::numbers::pi;
  const int radius = int(std::ceil(3 * std::sqrt(0.04 / (2 * kPi * kPi)) * pixels_per_degree));
  std::vector<glm::dvec3> result(picture[0].values.size(), glm::dvec3(0));
  glm::dvec3 total(0);
  for (int channel = 0; channel < 3; ++channel) {
    for (const Gaussian &of : kSensitivity[std::size_t(channel)]) {
      const double a = of.a, b = of.b;
      const Weights gauss = sampled(radius, [&](double x) {
        return std::exp(-kPi * kPi * x * x / (b * pixels_per_degree * pixels_per_degree));
      });
      const double sum = std::accumulate(gauss.begin(), gauss.end(), 0.0),
                   weight = a * std::sqrt(kPi / b);
      const Plane plane = filtered(picture[std::size_t(channel)], gauss, gauss);
      for (std::size_t i = 0; i < result.size(); ++i)
        result[i][channel] += weight * plane.values[i];
      total[channel] += weight * sum * sum;
    }
  }
  const std::uint32_t width = picture[0].width;
  parallel_for(picture[0].height, 0, [&](std::uint64_t row, std::uint32_t) {
    for (glm::dvec3 &color : std::span(result).subspan(row * width, width))
      color = hunt_lab_of_rgb(glm::clamp(rgb_of_opponent(color / total), 0.0, 1.0));
  });
  return result;
}

/// Strength of edges, or of points, in the lightness.
std::vector<double> features(const Plane &lightness, double pixels_per_degree, bool points) {
  const double sigma = 0.5 * 0.082 * pixels_per_degree;
  const int radius = int(std::ceil(3 * sigma));
  const auto gauss = [sigma](double x) { return std::exp(-x * x / (2 * sigma * sigma)); };
  const Weights smooth = normalized(sampled(radius, gauss));
  const Weights derivative = normalized(sampled(radius, [&](double x) {
    return points ? (x * x / (sigma * sigma) - 1) * gauss(x) : -x * gauss(x);
  }));
  std::vector<double> result = filtered(lightness, derivative, smooth).values;
  const std::vector<double> along_y = filtered(lightness, smooth, derivative).values;
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = std::hypot(result[i], along_y[i]);
  return result;
}

/// Colour distances as errors: the 0.7th power, of which the first 40 % of the largest fill 95 % of
/// [0,1].
double color_error(double distance) {
  constexpr double kPower = 0.7, kBreak = 0.4, kBreakError = 0.95;
  static const double kLargest =
      std::pow(hyab(hunt_lab_of_rgb({0, 1, 0}), hunt_lab_of_rgb({0, 0, 1})), kPower);
  const double error = std::pow(distance, kPower), limit = kBreak * kLargest;
  if (error < limit) return kBreakError / limit * error;
  return kBreakError + (error - limit) / (kLargest - limit) * (1 - kBreakError);
}

}  // namespace

struct Flip::View {
  std::uint32_t width, height;
  std::vector<glm::dvec3> colors;
  std::vector<double> edges, points;
};

Flip::View Flip::view_of(const Image8 &image, double pixels_per_degree) {
  const Planes picture = opponent_planes(image);
  Plane lightness = picture[0];
  for (double &value : lightness.values) value = (value + 16) / 116;
  return {image.width, image.height, as_seen(picture, pixels_per_degree),
          features(lightness, pixels_per_degree, false),
          features(lightness, pixels_per_degree, true)};
}

Flip::Flip(const Image8 &reference, double pixels_per_degree)
    : pixels_per_degree_(pixels_per_degree),
      reference_(std::make_unique<const View>(view_of(reference, pixels_per_degree))) {}
Flip::~Flip() = default;
Flip::Flip(Flip &&) noexcept = default;

std::vector<double> Flip::errors(const Image8 &test) const {
  const View &a = *reference_;
  check_same_size(a, test);
  const View b = view_of(test, pixels_per_degree_);
  std::vector<double> errors(a.colors.size());
  parallel_for(a.height, 0, [&](std::uint64_t row, std::uint32_t) {
    for (std::size_t i = row * a.width; i < (row + 1) * a.width; ++i) {
      const double color = color_error(hyab(a.colors[i], b.colors[i]));
      const double feature =
          std::max(std::abs(a.edges[i] - b.edges[i]), std::abs(a.points[i] - b.points[i]));
      errors[i] = std::pow(color, 1 - std::sqrt(feature / std::numbers::sqrt2));
    }
  });
  return errors;
}

double Flip::error(const Image8 &test) const {
  const std::vector<double> all = errors(test);
  double sum = 0;
  for (std::size_t row = 0; row < all.size(); row += test.width)  // sums of rows have small errors
    sum += std::accumulate(all.begin() + std::ptrdiff_t(row),
                           all.begin() + std::ptrdiff_t(row + test.width), 0.0);
  return sum / double(all.size());
}

}  // namespace isowave::core
