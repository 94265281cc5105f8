#include "core/march.hpp"

namespace isowave {

namespace {

ocl::Defines march_defines(std::uint32_t group_size, Solver solver, bool levels) {
  ocl::Defines defines = with_levels(group_defines(group_size), levels);
  defines.merge(solver_defines(solver));
  return defines;
}

}  // namespace

March::March(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size, Solver solver,
             bool levels)
    : range_(ocl::Range::strided(num_pixels, group_size, device)),
      // H100, 512^3: 0.07 ms instead of 0.09.
      start_range_(ocl::Range::strided(num_pixels, group_size, device, 4)),
      start_rays_(device, "march", "start_rays", march_defines(group_size, solver, levels)),
      march_(device, "march", "march", march_defines(group_size, solver, levels)),
      request_ahead_(device, "march", "request_ahead", march_defines(group_size, solver, levels)) {
  if (levels)
    cross_border_.emplace(device, "march", "cross_border", march_defines(group_size, solver, levels));
}

void March::start_rays(const Macrocells &macrocells, Wavefront &rays) {
  start_rays_(start_range_, rays.frame, macrocells.masks(), rays.counts, rays.next_counts,
              rays.next_active_ray_ids, rays.ray_block_ids, rays.hits);
}

void March::cross_border(const FrameParams &before, const Macrocells &macrocells_before,
                         const Macrocells &macrocells, Wavefront &rays) {
  (*cross_border_)(start_range_, before, rays.frame, macrocells_before.ranges(), macrocells.ranges(),
                   macrocells.masks(), rays.counts, rays.next_counts, rays.next_active_ray_ids,
                   rays.ray_block_ids, rays.hits);
}

void March::operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  march_(range_, rays.frame, macrocells.masks(), cache.table, cache.inside, cache.values,
         rays.previous_counts, rays.counts, rays.next_counts, rays.active_ray_ids, rays.next_active_ray_ids,
         rays.ray_block_ids, rays.hits, cache.state);
}

void March::request_ahead(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  request_ahead_(range_, rays.frame, macrocells.masks(), cache.table, rays.counts, rays.next_active_ray_ids,
                 rays.ray_block_ids, cache.slot_stamps, cache.requested_bits, cache.request_block_ids,
                 cache.capacity, cache.state);
}

}  // namespace isowave
