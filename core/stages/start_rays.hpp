#pragma once
// Pipeline `rays`: camera -> the pixels whose rays meet an active block (Sec. 3.2, 3.3;
// kernels_cl/start_rays.cl).

#include "core/stages/levelled_kernel.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/slot_type.hpp"
#include "kernels/start_rays.hpp"

namespace isowave::core {

class StartRays {
 public:
  /// levels: frames may have several levels of detail.
  StartRays(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size,
            bool levels = false, RaySource source = RaySource::kCamera,
            SlotType slot_type = SlotType::kFloat32);

  /// Begins a wave of rays.
  ///
  /// begins_frame  and with it a frame, for the stamps of cache slots
  /// macrocells  of any level of detail, since levels share what is used of them
  /// In          rays.counts: next_active_count is 0
  /// Out         rays.hits_of(source): none; next_active_ray_ids and ray_block_ids of the rays that
  ///             meet an active block; counts.next_active_count: their number
  /// Waits       no
  void operator()(const Macrocells &macrocells, Wavefront &rays, bool begins_frame = true);

 private:
  RaySource source_;
  ocl::Range range_;
  ClippedKernel<kernels::start_rays> kernel_;
};

}  // namespace isowave::core
