#pragma once
// Hit buffer -> framebuffer: a headlight, Blinn-Phong, and a light above it, on the hits'
// gradients.

#include <glm/glm.hpp>
#include <vector>

#include "core/io/png.hpp"
#include "core/ocl/kernel.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels_cl/portable/shade.h"

namespace isowave::core {

/// Colours are display values, [0,1].
struct Appearance {
  glm::vec3 surface{219 / 255.0f, 189 / 255.0f, 135 / 255.0f};
  glm::vec3 background{1.0f, 1.0f, 1.0f};
  float ambient = 0.15f;                  ///< light from all around
  float diffuse = 0.5f, specular = 0.2f;  ///< of a headlight at the eye
  float above = 0.45f;                    ///< diffuse, of a light above it
};

/// How many of a frame's ambient rays met nothing.
struct OpenCounts {
  std::vector<uchar> counts;      ///< [height * width] by ray
  std::uint32_t num_ambient = 0;  ///< of so many; 0: there are none
};

/// GLM's columns -> rows [9], scaled so that the largest entry is 1: only directions count.
void store_rows(const glm::dmat3 &m, float *rows);

ShadeParams make_shade_params(const VolumeInfo &info, const Appearance &appearance);

/// The same on the host, with the same bits.
///
/// hits     [height * width] of the frame's rays
/// samples  rays a pixel along each axis
/// open     how much of the sky hits see
/// Returns  RGB
Image8 shade_scalar(const FrameParams &frame, const ShadeParams &params,
                    const std::vector<HitRecord> &hits, std::uint32_t samples = 1,
                    const OpenCounts &open = {});

class Shade {
 public:
  /// max_pixels: of a picture.
  static ocl::BufferSizes sizes(std::uint64_t max_pixels);
  Shade(ocl::Device &device, std::uint64_t max_pixels);

  /// Launches the kernel without a pixel to shade, see Device::Compiling.
  void compile(Wavefront &rays);

  /// Shades rays.hits, as open as rays.open_counts says.
  ///
  /// samples  rays a pixel along each axis
  /// Returns  RGB
  /// Waits    yes
  Image8 operator()(const ShadeParams &params, Wavefront &rays, std::uint32_t samples = 1);
  /// The same as the kernel has it: RGBA, red in bits 0..7, A 0 where no ray of a pixel hits.
  std::vector<uint> packed(const ShadeParams &params, Wavefront &rays, std::uint32_t samples);

 private:
  ocl::Device &device_;
  ocl::Buffer<ShadeParams> params_;
  ocl::Buffer<uint> image_;
  ocl::Kernel<FrameParams, ocl::In<ShadeParams>, uint, ocl::In<HitRecord>, ocl::In<uchar>, uint,
              ocl::Out<uint>>
      kernel_;
};

}  // namespace isowave::core
