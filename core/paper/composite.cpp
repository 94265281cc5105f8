#include "core/paper/composite.hpp"

namespace isowave::core {

Composite::Composite(ocl::Device &device, std::uint64_t num_rays, ClosestHit closest,
                     SlotType slots)
    : range_(ocl::Range::strided(num_rays, ocl::kGroupSize, device)),
      kernel_(device, with_slots(closest_defines(closest), slots)) {}

void Composite::operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction) {
  kernel_(range_, rays.frame, rays.counts, rays.active_ray_ids, rays.pair_block_ids,
          rays.pair_begins, rays.pair_hits, rays.closest_pairs, cache.table, cache.values,
          rays.ray_block_ids, rays.hits, rays.mask);
  compaction(rays.mask, rays.active_ray_ids, rays.counts, ISO_COUNT_FIELD(active_count),
             rays.next_active_ray_ids, ISO_COUNT_FIELD(next_active_count));
}

}  // namespace isowave::core
