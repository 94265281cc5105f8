#pragma once
// Turns a frame that would never end into an error.

#include <cstdint>

#include <glm/vec3.hpp>

#include "core/base/error.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// Watches the counts of a frame's passes. A pass that ends no ray and brings no block still takes
/// the first of its rays on by a cell; so such passes in a row cannot be more than a ray has cells.
/// If they are, a kernel is at fault: there has been an OpenCL compiler whose code waited for
/// blocks that it never asked for.
class StallGuard {
 public:
  /// dims: of the volume [voxels].
  explicit StallGuard(const glm::uvec3 &dims) : limit_(std::uint64_t{dims.x} + dims.y + dims.z) {}

  /// counts: of the next pass.
  ///
  /// Throws  Error: there is no progress
  void check(const PassCounts &counts) {
    const bool stalled = counts.next_active_count >= counts.active_count &&
                         counts.requested_count == 0 && counts.decoded_count == 0;
    num_stalled_ = stalled ? num_stalled_ + 1 : 0;
    if (num_stalled_ > limit_)
      throw Error(
          "{} rays have waited for {} passes for blocks that none of them requests: a fault of "
          "isowave or of this OpenCL driver; please report it",
          counts.next_active_count, num_stalled_);
  }

 private:
  std::uint64_t limit_, num_stalled_ = 0;
};

}  // namespace isowave::core
