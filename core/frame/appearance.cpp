#include "core/frame/appearance.hpp"

#include <algorithm>
#include <cmath>

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
  params.ambient = appearance.ambient;
  params.diffuse = appearance.diffuse;
  params.specular = appearance.specular;
  params.above = appearance.above;
  params.transparent = appearance.transparent ? 1 : 0;
  return params;
}

Image8 shade_scalar(const FrameParams &frame, const ShadeParams &params,
                    const std::vector<HitRecord> &hits, std::uint32_t samples,
                    const OpenCounts &open) {
  const std::uint32_t columns = frame.view.width / samples, rows = frame.view.height / samples;
  const std::uint32_t channels = num_channels(&params);
  Image8 image{columns, rows, channels,
               std::vector<std::uint8_t>(std::size_t{channels} * columns * rows)};
  for (uint pixel = 0; pixel < columns * rows; ++pixel) {
    const uint rgba = shade_pixel(&frame, &params, samples, pixel % columns, pixel / columns,
                                  hits.data(), open.counts.data(), open.num_ambient);
    for (uint channel = 0; channel < channels; ++channel)
      image.pixels[std::size_t{channels} * pixel + channel] =
          static_cast<std::uint8_t>(rgba >> 8 * channel);
  }
  return image;
}

}  // namespace isowave::core
