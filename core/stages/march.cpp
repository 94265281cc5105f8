#include "core/stages/march.hpp"

#include "core/stages/solver_defines.hpp"

namespace isowave::core {

namespace {

ocl::Defines march_defines(std::uint32_t group_size, Solver solver) {
  ocl::Defines defines = group_defines(group_size);
  defines.merge(solver_defines(solver));
  return defines;
}

}  // namespace

March::March(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size, Solver solver,
             bool levels, RaySource source, SlotType slots)
    : source_(source),
      range_(ocl::Range::strided(num_pixels, group_size, device).in_parts(num_pixels, device)),
      kernel_(device, with_slots(march_defines(group_size, solver), slots), levels, source) {}

void March::operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  kernel_.of(rays)(range_, rays.frame, rays.level_frames, rays.num_level_frames, rays.clip,
                   range_.parts, rays.given, macrocells.masks(), macrocells.ranges(),
                   macrocells.no_data().words_or(macrocells.masks()), macrocells.no_data().begin,
                   cache.table, cache.inside, cache.changing, cache.values, rays.previous_counts,
                   rays.counts, rays.next_counts, rays.active_ray_ids, rays.next_active_ray_ids,
                   rays.ray_block_ids, rays.hits_of(source_), cache.slot_stamps, cache.state);
}

}  // namespace isowave::core
