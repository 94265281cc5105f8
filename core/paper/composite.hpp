#pragma once
// The closest of each ray's N_Spec results -> hit buffer; the rays that go on -> the next wavefront
// (Sec. 4.4).

#include "core/paper/closest_hit.hpp"
#include "core/paper/scan.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/composite.hpp"

namespace isowave::core {

class Composite {
 public:
  Composite(ocl::Device &device, std::uint64_t num_rays, ClosestHit closest = kDefaultClosestHit,
            SlotType slots = SlotType::kFloat32);

  /// In     rays.pair_hits, closest_pairs
  /// Out    rays.hits; ray_block_ids, where rays without slots wait; next_active_ray_ids;
  ///        counts.hit_count, next_active_count
  /// Waits  no
  void operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction);

 private:
  ocl::Range range_;
  ocl::Kernel<kernels::composite> kernel_;
};

}  // namespace isowave::core
