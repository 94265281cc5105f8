#include "core/stages/smooth_normals.hpp"

namespace isowave::core {

SmoothNormals::SmoothNormals(ocl::Device &device, std::uint64_t num_pixels,
                             std::uint32_t group_size, bool levels, SlotType slots)
    : range_(ocl::Range::strided(num_pixels, group_size, device, 4).in_parts(num_pixels, device)),
      kernel_(device, with_slots(group_defines(group_size), slots), levels) {}

void SmoothNormals::operator()(BlockCache &cache, Wavefront &rays, bool begins, RaySource of) {
  kernel_.of(rays)(range_, rays.frame, rays.level_frames, rays.num_level_frames, range_.parts,
                   begins ? 1u : 0u, cache.table, cache.values, rays.previous_counts, rays.counts,
                   rays.next_counts, rays.active_ray_ids, rays.next_active_ray_ids,
                   rays.hits_of(of), cache.slot_stamps, cache.requested_bits,
                   cache.request_block_ids, cache.capacity, cache.state);
}

}  // namespace isowave::core
