#pragma once
// A picture put aside while the same frame is drawn again with more pixels, whose place it takes
// until they are there. See kernels_cl/kept_picture.cl.

#include <cstdint>

#include "core/stages/wavefront.hpp"
#include "core/view/frame.hpp"
#include "kernels/kept_picture.hpp"

namespace isowave::core {

class KeptPicture {
 public:
  /// num_rays: of the largest picture that can be kept.
  static ocl::BufferSizes sizes(std::uint64_t num_rays);
  KeptPicture(ocl::Device &device, std::uint64_t num_rays);

  /// Launches the kernel without a pixel to show, see Device::Compiling.
  void compile(Wavefront &rays);
  /// Copies the hit buffer, a picture of that size.
  ///
  /// Throws  std::invalid_argument: a picture of more rays than the constructor was told
  /// Waits   no
  void keep(const Wavefront &rays, ImageSize size);
  /// Fills the hit buffer, a picture as large as rays.frame says, from the kept one, enlarged.
  ///
  /// everywhere  false: only for rays without a hit in the hit buffer
  /// Waits       no
  void show(Wavefront &rays, bool everywhere);

 private:
  ocl::Device &device_;
  ImageSize size_{0, 0};
  ocl::Buffer<HitRecord> hits_;
  ocl::Kernel<kernels::show_kept> show_;
};

}  // namespace isowave::core
