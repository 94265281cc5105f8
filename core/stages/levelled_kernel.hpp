#pragma once
// A kernel in several versions: for frames that the finest level of detail draws alone, and for
// others; for whole volumes, and for clipped ones.

#include <optional>

#include "core/ocl/kernel.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core {

/// Is the frame at work drawn by other levels than the finest?
inline bool draws_levels(const Wavefront &rays) {
  return rays.num_level_frames > 1 || rays.frame.place.begin_z != 0;
}

/// The macro for the kernels that clip rays.
inline ocl::Defines with_clip(ocl::Defines defines) {
  defines.insert({"ISO_CLIP", "1"});
  return defines;
}

template <class Signature>
class LevelledKernel {
 public:
  /// levels: frames may have several levels of detail.
  LevelledKernel(ocl::Device &device, const ocl::Defines &defines, bool levels)
      : finest_(device, defines) {
    if (levels) levels_.emplace(device, with_levels(defines, true));
  }

  /// The version for the frame at work.
  ocl::Kernel<Signature> &of(const Wavefront &rays) {
    return levels_ && draws_levels(rays) ? *levels_ : finest_;
  }

 private:
  ocl::Kernel<Signature> finest_;  ///< a tenth faster
  std::optional<ocl::Kernel<Signature>> levels_;
};

/// A kernel whose rays are clipped, if they are the camera's, or may begin at caps, if they are
/// given. Versions for such rays are compiled for the first frame that needs them.
template <class Signature>
class ClippedKernel {
 public:
  ClippedKernel(ocl::Device &device, const ocl::Defines &defines, bool levels, RaySource source)
      : device_(device),
        defines_(with_source(defines, source)),
        has_levels_(levels),
        is_given_(source == RaySource::kGiven),
        whole_(device, defines_, levels) {}

  ocl::Kernel<Signature> &of(const Wavefront &rays) {
    if (!(is_given_ ? rays.given_at_caps : rays.is_clipped())) return whole_.of(rays);
    if (!clipped_) clipped_.emplace(device_, with_clip(defines_), has_levels_);
    return clipped_->of(rays);
  }

 private:
  ocl::Device &device_;
  ocl::Defines defines_;
  bool has_levels_, is_given_;
  LevelledKernel<Signature> whole_;
  std::optional<LevelledKernel<Signature>> clipped_;
};

}  // namespace isowave::core
