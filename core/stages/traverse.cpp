#include "core/stages/traverse.hpp"

namespace isowave::core {

Traverse::Traverse(ocl::Device &device, std::uint64_t num_rays, std::uint32_t group_size)
    : range_(ocl::Range::strided(num_rays, group_size, device)),
      kernel_(device, "traverse", "traverse", group_defines(group_size)) {}

void Traverse::operator()(const Macrocells &macrocells, Wavefront &rays) {
  kernel_(range_, rays.frame, macrocells.masks(), rays.counts, rays.active_ray_ids,
          rays.ray_block_ids, rays.pair_block_ids, rays.closest_pairs);
}

}  // namespace isowave::core
