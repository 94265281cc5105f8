#include "core/stages/shade.hpp"

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

namespace {

Image8 rgb_image(std::uint32_t columns, std::uint32_t rows, const std::vector<uint> &packed) {
  Image8 image{columns, rows, 3, {}};
  image.pixels.reserve(3 * packed.size());
  for (const uint rgba : packed) {
    for (int shift = 0; shift < 24; shift += 8)
      image.pixels.push_back(static_cast<std::uint8_t>(rgba >> shift));
  }
  return image;
}

}  // namespace

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

ocl::BufferSizes Shade::sizes(std::uint64_t max_pixels) {
  return {ocl::buffer_size<ShadeParams>("shading", 1),
          ocl::buffer_size<uint>("framebuffer", max_pixels)};
}

Shade::Shade(ocl::Device &device, std::uint64_t max_pixels)
    : device_(device),
      params_(device, sizes(max_pixels)["shading"]),
      image_(device, sizes(max_pixels)["framebuffer"]),
      kernel_(device, "shade", "shade") {}

void Shade::compile(Wavefront &rays) {
  for (const std::size_t num_pixels :
       {std::size_t{1}, image_.size()}) {  // PoCL compiles large ones anew
    kernel_(ocl::Range::strided(num_pixels, ocl::kGroupSize, device_), FrameParams{}, params_, 1,
            rays.hits, rays.open_counts, 0u, image_);
  }
}

Image8 Shade::operator()(const ShadeParams &params, Wavefront &rays, std::uint32_t samples) {
  return rgb_image(rays.frame.view.width / samples, rays.frame.view.height / samples,
                   packed(params, rays, samples));
}

std::vector<uint> Shade::packed(const ShadeParams &params, Wavefront &rays, std::uint32_t samples) {
  const std::uint32_t columns = rays.frame.view.width / samples,
                      rows = rays.frame.view.height / samples;
  std::vector<uint> colors(std::size_t{columns} * rows);
  params_.write({&params, 1});
  kernel_(ocl::Range::strided(colors.size(), ocl::kGroupSize, device_), rays.frame, params_,
          samples, rays.hits, rays.open_counts, rays.num_ambient, image_);
  image_.read(colors);
  return colors;
}

}  // namespace isowave::core
