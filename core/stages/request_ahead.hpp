#pragma once
// Pipeline `rays`: rays that wait -> list of the blocks that they need next (Sec. 3.3, 3.4, 4;
// kernels_cl/request_ahead.cl).

#include "core/stages/block_cache.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "core/stages/macrocells.hpp"
#include "kernels/request_ahead.hpp"

namespace isowave::core {

class RequestAhead {
 public:
  /// levels: frames may have several levels of detail.
  RequestAhead(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size,
               bool levels = false, RaySource source = RaySource::kCamera);

  /// The rays that wait ask for blocks, as far as they are in the pass's window.
  ///
  /// macrocells  of any level of detail, since levels share what is used of them
  /// In          rays.next_active_ray_ids, ray_block_ids; counts.next_active_count, active_count,
  ///             window_count
  /// Out         the cache's requests, and the block that it must serve; counts.requested_count,
  ///             spec_count, pair_count, ahead_count
  /// Waits       no
  void operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays);

 private:
  ocl::Range range_;
  ClippedKernel<kernels::request_ahead> kernel_;
};

}  // namespace isowave::core
