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

Image8 rgb_image(std::uint32_t columns, std::uint32_t rows, const std::vector<uint> &packed) {
  Image8 image{columns, rows, 3, {}};
  image.pixels.reserve(3 * packed.size());
  for (const uint rgba : packed) {
    for (int shift = 0; shift < 24; shift += 8)
      image.pixels.push_back(static_cast<std::uint8_t>(rgba >> shift));
  }
  return image;
}

ShadeParams make_shade_params(const VolumeInfo &info, const Appearance &appearance) {
  ShadeParams params{};
  const glm::dmat3 index_to_world = info.index_to_world();
  store_rows(glm::transpose(glm::inverse(index_to_world)), params.normal);
  store_rows(index_to_world, params.view);
  params.surface_r = appearance.surface.r;
  params.surface_g = appearance.surface.g;
  params.surface_b = appearance.surface.b;
  params.background_r = appearance.background.r;
  params.background_g = appearance.background.g;
  params.background_b = appearance.background.b;
  params.ambient = appearance.ambient;
  params.diffuse = appearance.diffuse;
  params.specular = appearance.specular;
  params.above = appearance.above;
  return params;
}

Image8 shade_scalar(const FrameParams &frame, const ShadeParams &params,
                    const std::vector<HitRecord> &hits, std::uint32_t samples,
                    const OpenCounts &open) {
  const std::uint32_t columns = frame.view.width / samples, rows = frame.view.height / samples;
  std::vector<uint> packed(std::size_t{columns} * rows);
  for (uint pixel = 0; pixel < packed.size(); ++pixel)
    packed[pixel] = shade_pixel(&frame, &params, samples, pixel % columns, pixel / columns,
                                hits.data(), open.counts.data(), open.num_ambient);
  return rgb_image(columns, rows, packed);
}

}  // namespace isowave::core
