#pragma once
// How many blocks each ray looks ahead in a pass (Sec. 4): N_Spec = min(max, floor(W H / N_Act)),
// computed on the device.

#include "core/stages/wavefront.hpp"
#include "kernels/speculation.hpp"

namespace isowave::core {

class Speculation {
 public:
  explicit Speculation(ocl::Device &device) : begin_pass_(device) {}

  /// Opens a pass: the rays left by the last one become active.
  ///
  /// Out    rays.active_ray_ids; counts.active_count, spec_count; the other counts of a pass: 0;
  ///        next_counts, opened
  /// Waits  no
  void begin_pass(Wavefront &rays) {
    std::swap(rays.active_ray_ids, rays.next_active_ray_ids);
    begin_pass_({1, 1}, rays.frame, rays.counts, rays.next_counts);
  }

 private:
  ocl::Kernel<kernels::begin_pass> begin_pass_;
};

}  // namespace isowave::core
