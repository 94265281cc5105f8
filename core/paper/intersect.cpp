#include "core/paper/intersect.hpp"

#include <utility>

#include "core/stages/solver_defines.hpp"

namespace isowave::core {

namespace {

ocl::Defines intersect_defines(std::uint32_t group_size, Solver solver, ClosestHit closest,
                               SlotType slots) {
  ocl::Defines defines = group_defines(group_size);
  defines.merge(solver_defines(solver));
  defines.merge(closest_defines(closest));
  return with_slots(std::move(defines), slots);
}

}  // namespace

Intersect::Intersect(ocl::Device &device, std::uint64_t num_rays, std::uint32_t group_size,
                     Solver solver, ClosestHit closest, SlotType slots)
    : range_(ocl::Range::strided(num_rays, group_size, device).in_parts(num_rays, device)),
      kernel_(device, intersect_defines(group_size, solver, closest, slots)) {
  if (solver.kind == ISO_SOLVER_BERNSTEIN) {
    settle_doubts_.emplace(device, intersect_defines(group_size, solver, closest, slots));
  }
}

void Intersect::operator()(const BlockCache &cache, const BlockGroups &groups, Wavefront &rays) {
  kernel_(range_, rays.frame, range_.parts, rays.counts, groups.pair_ids, groups.block_rays,
          rays.pair_block_ids, cache.table, cache.values, rays.active_ray_ids, rays.pair_rays,
          rays.pair_hits, rays.closest_pairs);
  if (settle_doubts_) {
    (*settle_doubts_)(range_, rays.frame, range_.parts, rays.counts, groups.pair_ids,
                      rays.pair_block_ids, cache.table, cache.values, rays.active_ray_ids,
                      rays.pair_rays, rays.pair_hits, rays.closest_pairs);
  }
}

}  // namespace isowave::core
