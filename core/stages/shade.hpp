#pragma once
// Hit buffer -> framebuffer (core/frame/appearance.hpp, kernels_cl/shade.cl).

#include <cstdint>
#include <vector>

#include "core/frame/appearance.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/shade.hpp"

namespace isowave::core {

class Shade {
 public:
  /// max_pixels: of a picture.
  static ocl::BufferSizes sizes(std::uint64_t max_pixels);
  Shade(ocl::Device &device, std::uint64_t max_pixels);

  /// Launches the kernel without a pixel to shade, see Device::Compiling.
  void compile(Wavefront &rays);

  /// Shades rays.hits, with the ambient light that rays.open_counts lets through.
  ///
  /// samples  rays a pixel along each axis
  /// Returns  RGB
  /// Waits    yes
  Image8 operator()(const ShadeParams &params, Wavefront &rays, std::uint32_t samples = 1);
  /// The same as the kernel writes it: RGBA, red in bits 0..7, A 0 if no ray of a pixel hits.
  std::vector<uint> packed(const ShadeParams &params, Wavefront &rays, std::uint32_t samples);

 private:
  ocl::Device &device_;
  ocl::Buffer<ShadeParams> params_;
  ocl::Buffer<uint> image_;
  ocl::Kernel<kernels::shade> kernel_;
};

}  // namespace isowave::core
