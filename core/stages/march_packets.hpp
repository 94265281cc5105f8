#pragma once
// Pipeline `rays` on CPUs: start_rays and march in one, eight rays at a time
// (kernels_cl/march_packets.cl).

#include "core/stages/block_cache.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/solvers.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core {

class MarchPackets {
 public:
  /// Whether it is faster there than start_rays and march: on CPUs whose drivers hold eight floats
  /// in a vector. Mesa's llvmpipe makes vectors of work-items instead, and would leave them empty.
  static bool suits(const ocl::DeviceInfo &device);
  /// Whether it has that solver.
  static bool has(Solver solver) { return solver.kind == ISO_SOLVER_BERNSTEIN; }

  /// solver: one that it has.
  MarchPackets(ocl::Device &device, std::uint64_t num_pixels, Solver solver);

  /// Begins a frame, of the finest level of detail and rays of the camera.
  ///
  /// In     rays.counts: next_active_count is 0
  /// Waits  no
  void begin_frame(Wavefront &rays);

  /// Takes rays further, as far as what was requested in the pass before has been provided. In the
  /// first pass of a frame, these are the rays of the picture.
  ///
  /// Out    rays.hits, in the first pass all of them; next_active_ray_ids and ray_block_ids of the
  ///        rays that wait; counts.active_count: rays that had met an active block before;
  ///        hit_count, granted_count (blocks intersected), next_active_count
  /// Waits  no
  void operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays);

 private:
  ocl::Range range_;
  bool begins_ = false;  ///< the next pass is the first of its frame
  ocl::Kernel<ocl::In<PassCounts>, ocl::Out<PassCounts>> begin_;
  ocl::Kernel<FrameParams, uint, ocl::In<uint>, ocl::Out<BlockEntry>, ocl::In<ulong>,
              ocl::In<float>, ocl::In<PassCounts>, ocl::Out<PassCounts>, ocl::Out<PassCounts>,
              ocl::In<uint>, ocl::Out<uint>, ocl::Out<uint>, ocl::Out<HitRecord>, ocl::Out<uint>,
              ocl::Out<CacheState>>
      march_;
};

}  // namespace isowave::core
