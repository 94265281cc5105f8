#include "core/intersect.hpp"

namespace isowave {

Intersect::Intersect(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size)
    : range_(ocl::Range::strided(num_pixels, group_size, device)),
      kernel_(device, "intersect", "intersect", group_defines(group_size)) {}

void Intersect::operator()(const BlockCache &cache, const BlockGroups &groups, Wavefront &rays) {
  kernel_(range_, rays.frame, rays.counts, groups.pair_ids, groups.slots, groups.block_ray_offsets,
          cache.slot_block_ids(), cache.page_table(), cache.values(), rays.active_ray_ids, rays.pair_hits);
}

}  // namespace isowave
