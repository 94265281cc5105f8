#include "core/stages/composite.hpp"

#include "core/base/error.hpp"

namespace isowave::core {

std::string_view to_string(ClosestHit closest) {
  return closest == ClosestHit::kScan ? "scan" : "atomic-min";
}

ClosestHit closest_hit_from_string(std::string_view name) {
  for (const ClosestHit closest : {ClosestHit::kScan, ClosestHit::kAtomicMin}) {
    if (name == to_string(closest)) return closest;
  }
  throw Error("no way to the closest hit is called '{}'; there are: scan, atomic-min", name);
}

Composite::Composite(ocl::Device &device, std::uint64_t num_rays, ClosestHit closest)
    : range_(ocl::Range::strided(num_rays, ocl::kGroupSize, device)),
      kernel_(device, closest_defines(closest)) {}

void Composite::operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction) {
  kernel_(range_, rays.frame, rays.counts, rays.active_ray_ids, rays.pair_block_ids,
          rays.pair_begins, rays.pair_hits, rays.closest_pairs, cache.table, cache.values,
          rays.ray_block_ids, rays.hits, rays.mask);
  compaction(rays.mask, rays.active_ray_ids, rays.counts, ISO_COUNT_FIELD(active_count),
             rays.next_active_ray_ids, ISO_COUNT_FIELD(next_active_count));
}

}  // namespace isowave::core
