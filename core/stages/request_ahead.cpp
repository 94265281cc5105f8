#include "core/stages/request_ahead.hpp"

namespace isowave::core {

RequestAhead::RequestAhead(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size,
                           bool levels, RaySource source)
    : range_(ocl::Range::strided(num_pixels, group_size, device)),
      kernel_(device, group_defines(group_size), levels, source) {}

void RequestAhead::operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  kernel_.of(rays)(range_, rays.frame, rays.level_frames, rays.num_level_frames, rays.clip,
                   rays.given, macrocells.masks(), cache.table, rays.counts,
                   rays.next_active_ray_ids, rays.ray_block_ids, cache.slot_stamps,
                   cache.requested_bits, cache.request_block_ids, cache.capacity, cache.state);
}

}  // namespace isowave::core
