#pragma once
// Pipeline `rays`: camera -> hits, and the rays that wait, of a frame whose blocks are mostly
// cached (Sec. 3.2, 3.3, 3.7; kernels_cl/start_and_march.cl).

#include "core/frame/solvers.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/macrocells.hpp"
#include "kernels/start_and_march.hpp"

namespace isowave::core {

class StartAndMarch {
 public:
  StartAndMarch(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size,
                Solver solver, SlotType slots = SlotType::kFloat32);

  /// Begins a frame with the camera's rays in the pass at work, and takes them as far as blocks are
  /// cached. The frame has one level of detail, and is not clipped.
  ///
  /// In          rays.previous_counts: next_active_count is 0
  /// Out         rays.hits of all pixels; the rest as March
  /// Waits       no
  void operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays);

 private:
  ocl::Range range_;
  ocl::Kernel<kernels::start_and_march> kernel_;
};

}  // namespace isowave::core
