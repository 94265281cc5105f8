#include "core/stages/shade.hpp"

namespace isowave::core {

ocl::BufferSizes Shade::sizes(std::uint64_t max_pixels) {
  return {ocl::buffer_size<ShadeParams>("shading", 1),
          ocl::buffer_size<uint>("framebuffer", max_pixels)};
}

Shade::Shade(ocl::Device &device, std::uint64_t max_pixels)
    : device_(device),
      params_(device, sizes(max_pixels)["shading"]),
      image_(device, sizes(max_pixels)["framebuffer"]),
      kernel_(device) {}

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
