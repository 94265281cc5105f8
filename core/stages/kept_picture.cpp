#include "core/stages/kept_picture.hpp"

namespace isowave::core {

ocl::BufferSizes KeptPicture::sizes(std::uint64_t num_rays) {
  return {ocl::buffer_size<HitRecord>("kept hits", num_rays)};
}

KeptPicture::KeptPicture(ocl::Device &device, std::uint64_t num_rays)
    : device_(device), hits_(device, sizes(num_rays)["kept hits"]), show_(device) {}

void KeptPicture::compile(Wavefront &rays) {
  for (const std::uint64_t num_rays :
       {std::uint64_t{1}, rays.num_rays})  // PoCL compiles large ones anew
    show_(ocl::Range::each(num_rays, ocl::kGroupSize, device_), FrameParams{}, 1, 1, hits_, 0u,
          rays.hits);
}

void KeptPicture::keep(const Wavefront &rays, ImageSize size) {
  hits_.copy(rays.hits, size.num_rays());
  size_ = size;
}

void KeptPicture::show(Wavefront &rays, bool everywhere) {
  const std::uint64_t num_rays = std::uint64_t{rays.frame.view.width} * rays.frame.view.height;
  show_(ocl::Range::each(num_rays, ocl::kGroupSize, device_), rays.frame, size_.ray_columns(),
        size_.ray_rows(), hits_, everywhere ? 1u : 0u, rays.hits);
}

}  // namespace isowave::core
