#pragma once
// Camera -> the first block of every pixel's ray and the first wavefront (Sec. 3.2).

#include "core/paper/scan.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/initial_rays.hpp"

namespace isowave::core {

class InitialRays {
 public:
  explicit InitialRays(ocl::Device &device, std::uint64_t num_rays);

  /// In     rays.frame
  /// Out    rays.hits: none; ray_block_ids, next_active_ray_ids; counts.next_active_count
  /// Waits  no
  void operator()(Wavefront &rays, Compaction &compaction);

 private:
  ocl::Range range_;
  ocl::Kernel<kernels::initial_rays> kernel_;
};

}  // namespace isowave::core
