#include "core/march.hpp"

#include <utility>

namespace isowave {

namespace {

ocl::Defines march_defines(std::uint32_t group_size, Solver solver) {
  ocl::Defines defines = group_defines(group_size);
  defines.merge(solver_defines(solver));
  return defines;
}

}  // namespace

March::March(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size, Solver solver)
    : range_(ocl::Range::strided(num_pixels, group_size, device)),
      march_(device, "march", "march", march_defines(group_size, solver)),
      request_(device, "march", "request_blocks", march_defines(group_size, solver)) {}

void March::march_all(const Macrocells &macrocells, const BlockCache &cache, Wavefront &rays) {
  std::swap(rays.counts, rays.next_counts);
  launch(true, macrocells, cache, rays);
}

void March::request(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  std::swap(rays.counts, rays.next_counts);
  std::swap(rays.active_ray_ids, rays.next_active_ray_ids);
  request_(range_, rays.frame, macrocells.masks(), cache.table, cache.values, rays.next_counts, rays.counts,
           rays.active_ray_ids, rays.ray_block_ids, rays.hits, cache.slot_stamps, cache.requested_bits,
           cache.request_block_ids, cache.capacity, cache.state);
}

void March::march(const Macrocells &macrocells, const BlockCache &cache, Wavefront &rays) {
  launch(false, macrocells, cache, rays);
}

void March::launch(bool first, const Macrocells &macrocells, const BlockCache &cache, Wavefront &rays) {
  march_(range_, rays.frame, first, macrocells.masks(), cache.table, cache.values, rays.counts,
         rays.next_counts, rays.active_ray_ids, rays.next_active_ray_ids, rays.ray_block_ids, rays.hits);
}

}  // namespace isowave
