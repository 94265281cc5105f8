#include "core/frame/appearance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.hpp"

namespace isowave::core {

void store_rows(const glm::dmat3 &m, float *rows) {
  double largest = 0.0;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) largest = std::max(largest, std::abs(m[column][row]));
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      rows[3 * row + column] = static_cast<float>(m[column][row] / largest);
  }
}

void check_light(const std::optional<glm::dvec3> &towards_light) {
  if (!towards_light) return;
  const double length = glm::length(*towards_light);
  if (!(length > 1e-100 && length < 1e100))
    throw Error("a light in direction {} {} {} cannot be drawn: give a finite one that is not 0",
                towards_light->x, towards_light->y, towards_light->z);
}

ShadeParams make_shade_params(const VolumeInfo &info, const Appearance &appearance) {
  ShadeParams params{};
  const glm::dmat3 index_to_world = info.index_to_world();
  store_rows(glm::transpose(glm::inverse(index_to_world)), params.normal);
  store_rows(index_to_world, params.view);
  params.surface_r = appearance.surface.r;
  params.surface_g = appearance.surface.g;
  params.surface_b = appearance.surface.b;
  const glm::vec3 background = appearance.transparent ? glm::vec3(0) : appearance.background;
  params.background_r = background.r;
  params.background_g = background.g;
  params.background_b = background.b;
  if (appearance.background_top && !appearance.transparent) {
    const glm::vec3 rise = *appearance.background_top - background;
    params.rise_r = rise.r;
    params.rise_g = rise.g;
    params.rise_b = rise.b;
  }
  params.ambient = appearance.ambient;
  params.diffuse = appearance.diffuse;
  params.specular = appearance.specular;
  params.above = appearance.above;
  params.transparent = appearance.transparent ? 1 : 0;
  if (appearance.towards_light) {
    check_light(appearance.towards_light);
    const glm::dvec3 light = glm::normalize(*appearance.towards_light);
    params.has_light = 1;
    for (int i = 0; i < 3; ++i) params.light[i] = static_cast<float>(light[i]);
  }
  if (!appearance.color_by) return params;
  const ColorByAxis &by = *appearance.color_by;
  check_color_by(by);
  const glm::dvec3 axis = glm::normalize(by.axis) / (by.high - by.low);
  const glm::dvec3 of_index = glm::transpose(index_to_world) * axis;
  params.has_map = ISO_MAP_BY_AXIS;
  for (int i = 0; i < 3; ++i) params.axis[i] = static_cast<float>(of_index[i]);
  params.axis_begin = static_cast<float>(glm::dot(axis, info.origin) - by.low / (by.high - by.low));
  return params;
}

Shading make_shading(const VolumeInfo &info, const Appearance &appearance,
                     const std::optional<std::array<float, 2>> &field_range) {
  ShadeParams params = make_shade_params(info, appearance);
  if (appearance.color_by_field) {
    const ColorByField &by = *appearance.color_by_field;
    check_color_by_field(by);
    if (by.labels) {
      params.has_map = ISO_MAP_BY_LABEL;
      return {params, by.colors};
    }
    const std::array<float, 2> range = field_range.value_or(std::array{0.0f, 0.0f});
    const double low = by.low.value_or(range[0]), high = by.high.value_or(range[1]);
    params.has_map = ISO_MAP_BY_FIELD;
    params.field_low = static_cast<float>(low);
    const double scale = 1 / (high - low);
    params.field_scale = std::isfinite(scale) ? static_cast<float>(scale) : 0.0f;
    return {params, by.colors};
  }
  return appearance.color_by ? Shading(params, appearance.color_by->colors) : Shading(params);
}

void check_color_by(const ColorByAxis &color_by) {
  const double length = glm::length(color_by.axis);
  if (!(length > 0) || !std::isfinite(length))
    throw Error("colours along an axis need a direction that is finite and not 0 0 0");
  const double range = color_by.high - color_by.low;
  if (!std::isfinite(1 / range) || !std::isfinite(range))
    throw Error("colours cannot go from {} to {}: give two numbers that differ", color_by.low,
                color_by.high);
}

void check_color_by_field(const ColorByField &color_by) {
  constexpr double kMost = std::numeric_limits<float>::max();
  for (const std::optional<double> &end : {color_by.low, color_by.high}) {
    if (end && !(std::abs(*end) <= kMost))
      throw Error("colours cannot begin or end at {}: give a finite number", *end);
  }
  if (color_by.low && color_by.low == color_by.high)
    throw Error("colours cannot go from {} to {}: give two numbers that differ", *color_by.low,
                *color_by.high);
}

std::array<double, 2> range_along(const VolumeInfo &info, const glm::dvec3 &axis) {
  const glm::dvec3 direction = glm::normalize(axis);
  std::array<double, 2> range{std::numeric_limits<double>::infinity(),
                              -std::numeric_limits<double>::infinity()};
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 side(corner & 1, corner >> 1 & 1, corner >> 2);
    const glm::dvec3 at = side * (glm::dvec3(info.dims) - 1.0);
    const double along = glm::dot(direction, info.origin + info.index_to_world() * at);
    range = {std::min(range[0], along), std::max(range[1], along)};
  }
  return range;
}

Image8 shade_scalar(const FrameParams &frame, const Shading &shading,
                    const std::vector<HitRecord> &hits, std::uint32_t samples,
                    const OpenCounts &open, const std::vector<float> &field_values) {
  const LightOfHits light = open.of_hits();
  return image_of_pixels(frame, shading.params, samples, [&](uint column, uint row) {
    return shade_pixel(&frame, &shading.params, shading.color_map.data(), samples, column, row,
                       hits.data(), &light, field_values.data());
  });
}

}  // namespace isowave::core
