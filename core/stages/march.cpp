#include "core/stages/march.hpp"

namespace isowave::core {

namespace {

ocl::Defines march_defines(std::uint32_t group_size, Solver solver, bool levels) {
  ocl::Defines defines = with_levels(group_defines(group_size), levels);
  defines.merge(solver_defines(solver));
  return defines;
}

}  // namespace

March::Kernels::Kernels(ocl::Device &device, const ocl::Defines &defines)
    : start_rays(device, "march", "start_rays", defines),
      march(device, "march", "march", defines),
      request_ahead(device, "march", "request_ahead", defines) {}

March::March(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size, Solver solver,
             bool levels)
    : range_(ocl::Range::strided(num_pixels, group_size, device)),
      // H100, 512^3: 0.07 ms instead of 0.09.
      start_range_(ocl::Range::strided(num_pixels, group_size, device, 4)),
      finest_(device, march_defines(group_size, solver, false)) {
  if (levels) levels_.emplace(device, march_defines(group_size, solver, true));
}

March::Kernels &March::kernels_for(const Wavefront &rays) {
  return levels_ && (rays.num_level_frames > 1 || rays.frame.id_begin_z != 0) ? *levels_ : finest_;
}

void March::start_rays(const Macrocells &macrocells, Wavefront &rays) {
  kernels_for(rays).start_rays(start_range_, rays.frame, rays.level_frames, rays.num_level_frames,
                               macrocells.masks(), macrocells.ranges(), rays.counts,
                               rays.next_counts, rays.next_active_ray_ids, rays.ray_block_ids,
                               rays.hits);
}

void March::operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  kernels_for(rays).march(range_, rays.frame, rays.level_frames, rays.num_level_frames,
                          macrocells.masks(), macrocells.ranges(), cache.table, cache.inside,
                          cache.values, rays.previous_counts, rays.counts, rays.next_counts,
                          rays.active_ray_ids, rays.next_active_ray_ids, rays.ray_block_ids,
                          rays.hits, cache.slot_stamps, cache.state);
}

void March::request_ahead(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  kernels_for(rays).request_ahead(
      range_, rays.frame, rays.level_frames, rays.num_level_frames, macrocells.masks(), cache.table,
      rays.counts, rays.next_active_ray_ids, rays.ray_block_ids, cache.slot_stamps,
      cache.requested_bits, cache.request_block_ids, cache.capacity, cache.state);
}

}  // namespace isowave::core
