#pragma once
// A volume, and a second one, the field, that its surfaces have colours by.

#include <cmath>

#include "core/frame/appearance.hpp"
#include "core/frame/frame_request.hpp"
#include "core/view/color_maps.hpp"
#include "tests/frame_scene.hpp"

namespace isowave::core::test {

inline CompressedVolume compressed_at_12_bits(const VolumeInfo &info, const VoxelFunction &values) {
  ArrayReader reader(info, sample(info.dims, values));
  return compress(reader, {.rate = 12, .levels = 0});
}

inline CompressedVolume turned_gyroid() {
  VolumeInfo info = grid_info({30, 27, 34});
  info.spacing = {0.5, 0.7, 0.4};
  info.origin = {300, -20, 11};
  info.direction = glm::dmat3({0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1});
  return compressed_at_12_bits(info, gyroid_field(11));
}

/// Another grid, turned and with other spacing, which has a part of the gyroid's hits.
inline CompressedVolume field_of_gyroid() {
  VolumeInfo info = grid_info({23, 41, 18});
  info.spacing = {0.6, 0.3, 0.7};
  info.origin = {298.2, -1.8, 10.2};
  info.direction = glm::dmat3({0, -1, 0}, {0.96, 0, 0.28}, {-0.28, 0, 0.96});
  return compressed_at_12_bits(info, [](const glm::dvec3 &p) {
    return std::sin(0.31 * p.x) + 0.1 * p.y + std::cos(0.4 * p.z) * 0.5;
  });
}

/// The half of a volume behind its middle, as a camera sees it.
inline Clip far_half(const VolumeInfo &info, const Camera &camera) {
  const glm::dvec3 middle =
      info.origin + info.index_to_world() * (0.5 * (glm::dvec3(info.dims) - 1.0));
  const glm::dvec3 normal = camera.at - camera.eye;
  Clip clip;
  clip.planes = {{.normal = normal, .offset = glm::dot(normal, middle)}};
  return clip;
}

inline Appearance by_field() {
  return {.color_by_field = ColorByField{.colors = color_map("viridis")}};
}

}  // namespace isowave::core::test
