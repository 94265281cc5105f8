#include "core/stages/start_and_march.hpp"

#include "core/stages/solver_defines.hpp"

namespace isowave::core {

namespace {

ocl::Defines defines_of(std::uint32_t group_size, Solver solver, SlotType slots) {
  ocl::Defines defines = group_defines(group_size);
  defines.merge(solver_defines(solver));
  return with_slots(defines, slots);
}

}  // namespace

StartAndMarch::StartAndMarch(ocl::Device &device, std::uint64_t num_pixels,
                             std::uint32_t group_size, Solver solver, SlotType slots)
    : range_(ocl::Range::strided(num_pixels, group_size, device, 16)),
      kernel_(device, defines_of(group_size, solver, slots)) {}

void StartAndMarch::operator()(const Macrocells &macrocells, BlockCache &cache, Wavefront &rays) {
  kernel_(range_, rays.frame, macrocells.masks(), cache.table, cache.inside, cache.changing,
          cache.values, rays.previous_counts, rays.counts, rays.next_counts,
          rays.next_active_ray_ids, rays.ray_block_ids, rays.hits, cache.slot_stamps, cache.state);
}

}  // namespace isowave::core
