#pragma once
// Rays -> the next N_Spec blocks of each ray that may hold the isosurface (Sec. 3.3, 4.1).

#include "core/ocl/kernel.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core {

class Traverse {
 public:
  Traverse(ocl::Device &device, std::uint64_t num_rays, std::uint32_t group_size);

  /// In     rays.active_ray_ids; ray_block_ids, where each ray goes on from; counts.spec_count
  /// Out    rays.pair_block_ids; ray_block_ids, the first block not looked at; counts.pair_count
  /// Waits  no
  void operator()(const Macrocells &macrocells, Wavefront &rays);

 private:
  ocl::Range range_;
  ocl::Kernel<FrameParams, ocl::In<uint>, ocl::Out<PassCounts>, ocl::In<uint>, ocl::Out<uint>,
              ocl::Out<uint>, ocl::Out<uint>>
      kernel_;
};

}  // namespace isowave::core
