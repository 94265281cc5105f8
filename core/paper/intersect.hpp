#pragma once
// A block's rays against its dual grid -> a result per ray-block pair (Sec. 3.7, 4.3).

#include <optional>

#include "core/frame/solvers.hpp"
#include "core/paper/group.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/intersect.hpp"

namespace isowave::core {

class Intersect {
 public:
  Intersect(ocl::Device &device, std::uint64_t num_rays, std::uint32_t group_size,
            Solver solver = kDefaultSolver, ClosestHit closest = kDefaultClosestHit,
            SlotType slots = SlotType::kFloat32);

  /// Out    rays.pair_hits of every pair in `groups`; rays.closest_pairs
  /// Waits  no
  void operator()(const BlockCache &cache, const BlockGroups &groups, Wavefront &rays);

 private:
  ocl::Range range_;
  ocl::Kernel<kernels::intersect> kernel_;
  /// Only a solver that can be in doubt has it.
  std::optional<ocl::Kernel<kernels::settle_doubts>> settle_doubts_;
};

}  // namespace isowave::core
