#pragma once
// Pipeline `rays`: each ray walks through the blocks that are cached until it hits, leaves, or
// waits for one that is not (Sec. 3.3, 3.7, 4.4 in one stage; kernels_cl/march.cl).

#include <optional>

#include "core/ocl/kernel.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/solvers.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core {

class March {
 public:
  /// levels: frames may have several levels of detail.
  March(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size, Solver solver,
        bool levels = false);

  /// macrocells: of any level of detail, since levels share what is used of them.
  /// Begins a frame: rays.hits are none, rays.next_active_ray_ids those that meet an active block;
  /// their count goes to counts.next_active_count, the frame before having left 0 there.
  /// Asynchronous.
  void start_rays(const Macrocells &macrocells, Wavefront &rays);

  /// Takes rays further, as far as what was requested in the pass before has been provided. Out:
  /// rays.hits, next_active_ray_ids, ray_block_ids; counts.hit_count, granted_count (blocks
  /// intersected), next_active_count. Asynchronous.
  void operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays);

  /// The rays that wait ask for blocks. Out: the cache's requests, counts.requested_count.
  /// Asynchronous.
  void request_ahead(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays);

 private:
  struct Kernels {
    Kernels(ocl::Device &device, const ocl::Defines &defines);
    ocl::Kernel<FrameParams, ocl::In<FrameParams>, uint, ocl::In<uint>, ocl::In<cl_ushort>,
                ocl::Out<PassCounts>, ocl::Out<PassCounts>, ocl::Out<uint>, ocl::Out<uint>,
                ocl::Out<HitRecord>>
        start_rays;
    ocl::Kernel<FrameParams, ocl::In<FrameParams>, uint, ocl::In<uint>, ocl::In<cl_ushort>,
                ocl::Out<BlockEntry>, ocl::In<ulong>, ocl::In<float>, ocl::In<PassCounts>,
                ocl::Out<PassCounts>, ocl::Out<PassCounts>, ocl::In<uint>, ocl::Out<uint>,
                ocl::Out<uint>, ocl::Out<HitRecord>, ocl::Out<uint>, ocl::Out<CacheState>>
        march;
    ocl::Kernel<FrameParams, ocl::In<FrameParams>, uint, ocl::In<uint>, ocl::In<BlockEntry>,
                ocl::Out<PassCounts>, ocl::In<uint>, ocl::In<uint>, ocl::Out<uint>, ocl::Out<uint>,
                ocl::Out<uint>, uint, ocl::Out<CacheState>>
        request_ahead;
  };
  Kernels &kernels_for(const Wavefront &rays);

  ocl::Range range_, start_range_;
  Kernels finest_;                 ///< for frames that the finest level draws alone: a tenth faster
  std::optional<Kernels> levels_;  ///< for all others
};

}  // namespace isowave::core
