#include "core/sources/field_rows.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/sources/noise_field.hpp"

namespace isowave::core {

namespace {

/// A field given as a function of the position p of generate.hpp.
template <class Function>
class AnalyticRows : public FieldRows {
 public:
  AnalyticRows(const glm::uvec3 &dims, Function function)
      : last_(glm::dvec3(dims) - 1.0),
        scale_(1.0 / std::max({last_.x, last_.y, last_.z})),
        function_(function) {}

  void evaluate(std::uint32_t y, std::uint32_t z, std::span<double> row) const override {
    const double py = (2.0 * y - last_.y) * scale_, pz = (2.0 * z - last_.z) * scale_;
    for (std::size_t x = 0; x < row.size(); ++x) {
      const double px = (2.0 * double(x) - last_.x) * scale_;
      row[x] = std::clamp(function_(glm::dvec3(px, py, pz)), 0.0, 1.0);
    }
  }

 private:
  glm::dvec3 last_;
  double scale_;
  Function function_;
};

template <class Function>
std::unique_ptr<FieldRows> make_analytic(const glm::uvec3 &dims, Function function) {
  return std::make_unique<AnalyticRows<Function>>(dims, function);
}

double length(const glm::dvec3 &p) {
  return std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
}

double marschner_lobb(const glm::dvec3 &p) {
  constexpr double kFrequency = 6, kAmplitude = 0.25, kPi = std::numbers::pi;
  const double r = std::sqrt(p.x * p.x + p.y * p.y);
  const double rings = std::cos(2 * kPi * kFrequency * std::cos(kPi * r / 2));
  return ((1 - std::sin(kPi * p.z / 2)) + kAmplitude * (1 + rings)) / (2 * (1 + kAmplitude));
}

double gyroid(const glm::dvec3 &p) {
  const glm::dvec3 q = p * (4 * std::numbers::pi);
  const double sum =
      std::sin(q.x) * std::cos(q.y) + std::sin(q.y) * std::cos(q.z) + std::sin(q.z) * std::cos(q.x);
  return 0.5 + sum / 3;  // |sum| <= 1.5
}

double plane(const glm::dvec3 &p) {
  constexpr double kX = 0.36, kY = 0.48, kZ = 0.8;  // unit length
  return 0.5 + (kX * p.x + kY * p.y + kZ * p.z) / (2 * (kX + kY + kZ));
}

double shell(const glm::dvec3 &p) {
  constexpr double kRadius = 0.8, kBend = 0.02, kHalfWidth = 0.12;
  const double bend = std::sin(5 * p.x + 1) + std::sin(6 * p.y + 2) + std::sin(7 * p.z + 3);
  const double s = std::clamp((kRadius - length(p) + kBend * bend) / kHalfWidth, -1.0, 1.0);
  return (128 + 127 * s * (3 - s * s) / 2) / 255;
}

}  // namespace

std::unique_ptr<FieldRows> make_field_rows(Field field, const glm::uvec3 &dims,
                                           std::uint64_t seed) {
  switch (field) {
    case Field::kSphere:
      return make_analytic(dims,
                           [](const glm::dvec3 &p) { return 1 - length(p) / std::sqrt(3.0); });
    case Field::kPlane:
      return make_analytic(dims, plane);
    case Field::kSaddle:
      return make_analytic(dims, [](const glm::dvec3 &p) { return 0.5 + (p.z - p.x * p.y) / 4; });
    case Field::kMarschnerLobb:
      return make_analytic(dims, marschner_lobb);
    case Field::kGyroid:
      return make_analytic(dims, gyroid);
    case Field::kShell:
      return make_analytic(dims, shell);
    default:
      break;
  }
  std::optional<NoiseField> noise = make_noise_field(field, dims, seed);
  if (!noise) throw std::invalid_argument("make_field_rows: unknown field");
  return make_noise_rows(std::move(*noise), dims.x);
}

}  // namespace isowave::core
