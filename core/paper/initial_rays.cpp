#include "core/paper/initial_rays.hpp"

#include <utility>

namespace isowave::core {

InitialRays::InitialRays(ocl::Device &device, std::uint64_t num_rays)
    : range_(ocl::Range::strided(num_rays, ocl::kGroupSize, device).in_parts(num_rays, device)),
      kernel_(device) {}

void InitialRays::operator()(Wavefront &rays, Compaction &compaction) {
  kernel_(range_, rays.frame, range_.parts, rays.hits, rays.ray_block_ids, rays.active_ray_ids,
          rays.mask, rays.counts);
  compaction(rays.mask, rays.active_ray_ids, rays.counts, ISO_COUNT_FIELD(ray_count),
             rays.next_active_ray_ids, ISO_COUNT_FIELD(next_active_count));
}

}  // namespace isowave::core
