#include "core/composite.hpp"

namespace isowave {

namespace {
constexpr std::uint32_t kGroupSize = 64;
}

Composite::Composite(ocl::Device &device, std::uint64_t num_pixels)
    : range_(ocl::Range::strided(num_pixels, kGroupSize, device)),
      kernel_(device, "composite", "composite") {}

void Composite::operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction) {
  kernel_(range_, rays.frame, rays.counts, rays.active_ray_ids, rays.pair_block_ids, rays.pair_hits,
          cache.table, cache.values, rays.ray_block_ids, rays.hits, rays.mask);
  compaction.values(rays.mask, rays.active_ray_ids, rays.counts, ISO_COUNT_FIELD(active_count),
                    rays.next_active_ray_ids, ISO_COUNT_FIELD(next_active_count));
}

}  // namespace isowave
