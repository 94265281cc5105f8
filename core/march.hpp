#pragma once
// Pipeline `rays`: each ray walks through the blocks that are cached until it hits, leaves, or waits for one that is not
// (Sec. 3.3, 3.7, 4.4 in one stage; kernels_cl/march.cl).

#include "core/block_cache.hpp"
#include "core/macrocells.hpp"
#include "core/ocl/kernel.hpp"
#include "core/solvers.hpp"
#include "core/wavefront.hpp"

namespace isowave {

class March {
 public:
  March(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size, Solver solver);

  /// Begins a frame: every pixel's ray, as far as the cache goes. Out: rays.hits, next_active_ray_ids, ray_block_ids,
  /// counts.hit_count, granted_count (blocks intersected), next_active_count. Asynchronous.
  void march_all(const Macrocells &macrocells, const BlockCache &cache, Wavefront &rays);
  /// Opens a pass: the rays that wait ask for their next blocks. Out: counts.requested_count. Asynchronous.
  void request(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays);
  /// Takes the rays that wait further. Out: as march_all(). Asynchronous.
  void march(const Macrocells &macrocells, const BlockCache &cache, Wavefront &rays);

 private:
  void launch(bool first, const Macrocells &macrocells, const BlockCache &cache, Wavefront &rays);

  ocl::Range range_;
  ocl::Kernel<ocl::In<FrameParams>, uint, ocl::In<uint>, ocl::In<BlockEntry>, ocl::In<float>,
              ocl::Out<PassCounts>, ocl::Out<PassCounts>, ocl::In<uint>, ocl::Out<uint>, ocl::Out<uint>,
              ocl::Out<HitRecord>>
      march_;
  ocl::Kernel<ocl::In<FrameParams>, ocl::In<uint>, ocl::In<BlockEntry>, ocl::In<float>, ocl::In<PassCounts>,
              ocl::Out<PassCounts>, ocl::In<uint>, ocl::Out<uint>, ocl::Out<HitRecord>, ocl::Out<uint>,
              ocl::Out<uint>, ocl::Out<uint>, uint, ocl::Out<CacheState>>
      request_;
};

}  // namespace isowave
