#pragma once
// Pipeline `rays`: each ray walks through the blocks that are cached until it hits, leaves, or
// waits for one that is not (Sec. 3.3, 3.7, 4.4 in one stage; kernels_cl/march.cl).

#include "core/frame/solvers.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/levelled_kernel.hpp"
#include "core/stages/macrocells.hpp"
#include "kernels/march.hpp"

namespace isowave::core {

class March {
 public:
  /// levels: frames may have several levels of detail.
  March(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size, Solver solver,
        bool levels = false, RaySource source = RaySource::kCamera,
        SlotType slots = SlotType::kFloat32);

  /// Takes rays further, as far as what was requested in the pass before has been provided.
  ///
  /// macrocells  of any level of detail, since levels share what is used of them
  /// Out         rays.hits_of(source); next_active_ray_ids and ray_block_ids of the rays that wait;
  ///             counts.hit_count, granted_count (blocks intersected), next_active_count
  /// Waits       no
  void operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays);

 private:
  RaySource source_;
  ocl::Range range_;
  ClippedKernel<kernels::march> kernel_;
};

}  // namespace isowave::core
