#pragma once
// Shading of hits: a headlight, Blinn-Phong, and a light above it, on the hits' gradients.

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "core/io/png.hpp"
#include "core/volume/volume.hpp"
#include "kernels_cl/portable/shade.h"

namespace isowave::core {

/// Colours of a map, from low to high: words, red in bits 0..7, green 8..15, blue 16..23.
using ColorTable = std::array<uint, ISO_MAP_COLORS>;

/// Colours of surfaces by the distance along an axis: that of a point from the world's origin.
struct ColorByAxis {
  glm::dvec3 axis{0, 0, 1};  ///< world space, of any length above 0
  double low = 0, high = 1;  ///< distances of the first and the last colour [world units]
  ColorTable colors{};

  friend bool operator==(const ColorByAxis &, const ColorByAxis &) = default;
};

/// Colours of surfaces by the values of a field at the hits (FrameRequest::field_values). Hits
/// without a value have the surface's own colour.
struct ColorByField {
  /// Values of the first and the last colour; none: the least and the largest at the frame's hits,
  /// or in frames of several or translucent surfaces, of the field.
  std::optional<double> low{}, high{};
  ColorTable colors{};
  /// Values are labels (FrameRequest::field_labels): label L has colour L % ISO_MAP_COLORS, and
  /// there is no range. Values that are no labels have the surface's own colour.
  bool labels = false;

  friend bool operator==(const ColorByField &, const ColorByField &) = default;
};

/// Colours and lights. Colours are display values, [0,1].
struct Appearance {
  glm::vec3 surface{219 / 255.0f, 189 / 255.0f, 135 / 255.0f};
  glm::vec3 background{1.0f, 1.0f, 1.0f};
  float ambient = 0.15f;  ///< light from all around
  float diffuse = 0.5f;   ///< diffuse light of a headlight at the eye
  float specular = 0.2f;  ///< its highlight
  float above = 0.45f;    ///< diffuse light from above the headlight
  /// Pictures are RGBA with straight alpha: the share of a pixel's rays that hit, and the mean
  /// colour of those alone; 0 0 0 0 if none hits. There is no background.
  bool transparent = false;
  std::optional<ColorByAxis> color_by{};         ///< instead of `surface`
  std::optional<ColorByField> color_by_field{};  ///< the same; at most one of the two
  /// Direction towards a light of the scene, in world space, of any length above 0. `above` is then
  /// its weight.
  std::optional<glm::dvec3> towards_light{};
  /// The background goes linearly from `background` at the picture's lower edge to this one at the
  /// upper; none: it is uniform.
  std::optional<glm::vec3> background_top{};

  friend bool operator==(const Appearance &, const Appearance &) = default;
};

/// What shading needs.
struct Shading {
  // NOLINTNEXTLINE(google-explicit-constructor): without a colour map
  Shading(const ShadeParams &of) : params(of) {}
  Shading(const ShadeParams &of, const ColorTable &map) : params(of), color_map(map) {}

  ShadeParams params;
  ColorTable color_map{};
};

/// The numbers of ambient and shadow rays of each hit that met nothing, and bounced light.
struct OpenCounts {
  std::vector<uchar> counts;      ///< [height * width] by ray; [2] with shadow rays
  std::uint32_t num_ambient = 0;  ///< ambient rays of each hit; 0: there are none
  std::uint32_t num_shadow = 0;   ///< shadow rays of each hit; 0: there are none
  std::vector<float> bounced{};   ///< [height * width] by ray: LightOfHits::bounced, filtered
  std::uint32_t num_bounced = 0;  ///< ambient rays in these sums; 0: light does not bounce
  bool by_color = false;          ///< of layers: bounced is [ISO_LAYER_SUMS][height * width]

  LightOfHits of_hits() const {
    return {counts.data(),  num_ambient, num_shadow,
            bounced.data(), num_bounced, by_color ? 1u : 0u};
  }
};

/// Stores GLM's columns as rows [9], scaled so that the largest entry is 1: only directions count.
void store_rows(const glm::dmat3 &m, float *rows);

/// Throws  Error: a range that is empty or not finite; an axis without a direction
void check_color_by(const ColorByAxis &color_by);
/// Throws  Error: the direction is none
void check_light(const std::optional<glm::dvec3> &towards_light);
/// Throws  Error: a range that is empty or not finite
void check_color_by_field(const ColorByField &color_by);

/// The distances along an axis that a volume's box has: low, high.
std::array<double, 2> range_along(const VolumeInfo &info, const glm::dvec3 &axis);

ShadeParams make_shade_params(const VolumeInfo &info, const Appearance &appearance);
/// field_range  values of a field, for ends that ColorByField does not give
/// Throws       Error: as check_color_by()
Shading make_shading(const VolumeInfo &info, const Appearance &appearance,
                     const std::optional<std::array<float, 2>> &field_range = {});

/// RGB, or RGBA if transparent, of a frame's pixels.
///
/// samples  rays per pixel along each axis
/// Pixel    (uint column, uint row) -> RGBA, red in bits 0..7
template <class Pixel>
Image8 image_of_pixels(const FrameParams &frame, const ShadeParams &params, std::uint32_t samples,
                       Pixel pixel_at) {
  const std::uint32_t columns = frame.view.width / samples, rows = frame.view.height / samples;
  const std::uint32_t channels = num_channels(&params);
  Image8 image{columns, rows, channels,
               std::vector<std::uint8_t>(std::size_t{channels} * columns * rows)};
  for (uint pixel = 0; pixel < columns * rows; ++pixel) {
    const uint rgba = pixel_at(pixel % columns, pixel / columns);
    for (uint channel = 0; channel < channels; ++channel)
      image.pixels[std::size_t{channels} * pixel + channel] =
          static_cast<std::uint8_t>(rgba >> 8 * channel);
  }
  return image;
}

/// The picture of a frame, made on the host with the bits of a device's (kernels_cl/shade.cl).
///
/// hits     [height * width] hits of the frame's rays
/// samples  rays per pixel along each axis
/// open     open ambient rays of the hits, and lit shadow rays
/// field_values  [height * width] of a field, if colours are by it
/// Returns  RGB, or RGBA if transparent
Image8 shade_scalar(const FrameParams &frame, const Shading &shading,
                    const std::vector<HitRecord> &hits, std::uint32_t samples = 1,
                    const OpenCounts &open = {}, const std::vector<float> &field_values = {});

}  // namespace isowave::core
