#pragma once
// A kernel in two versions: for frames that the finest level of detail draws alone, and for others.

#include <optional>

#include "core/ocl/kernel.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core {

/// Is the frame at work drawn by other levels than the finest?
inline bool draws_levels(const Wavefront &rays) {
  return rays.num_level_frames > 1 || rays.frame.place.begin_z != 0;
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

}  // namespace isowave::core
