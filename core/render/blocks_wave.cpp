#include "core/render/blocks_wave.hpp"

namespace isowave::core {

ocl::BufferSizes BlocksWave::sizes(const Group::Limits &limits, bool scanned_pairs) {
  return Compaction::sizes(limits.num_rays, limits.group_size)
      .add(Traverse::sizes(limits.num_rays, limits.group_size, scanned_pairs))
      .add(Group::sizes(limits));
}

BlocksWave::BlocksWave(BlockStore &blocks, Wavefront &rays, const Group::Limits &limits,
                       Solver solver, ClosestHit closest)
    : blocks_(blocks),
      rays_(rays),
      compaction_(blocks.device, limits.num_rays, limits.group_size),
      initial_rays_(blocks.device, limits.num_rays),
      speculation_(blocks.device),
      traverse_(blocks.device, limits.num_rays, limits.group_size, rays.pair_rays.size() != 0),
      group_(blocks.device, limits, closest),
      intersect_(blocks.device, limits.num_rays, limits.group_size, solver, closest),
      composite_(blocks.device, limits.num_rays, closest) {}

void BlocksWave::begin() {
  if (blocks_.has_requests()) {  // of normals or ambient rays: this pipeline's passes answer theirs
    rays_.forget_rays();
    rays_.open_pass();
    blocks_.provide(rays_);
    blocks_.forget_requests();
  }
  const auto stage = blocks_.device.timer().stage("initial_rays");
  initial_rays_(rays_, compaction_);
}

void BlocksWave::enqueue_pass() {
  ocl::StageTimer &timer = blocks_.device.timer();
  const auto pass = timer.stage("speculation");
  speculation_.begin_pass(rays_);
  {
    const auto stage = timer.stage("traverse");
    traverse_(blocks_.levels[0].macrocells, rays_);
  }
  {
    const auto stage = timer.stage("request");
    blocks_.cache.request(rays_);
  }
  blocks_.provide(rays_.counts, blocks_.drawing, rays_);
  if (blocks_.counts_touched) {
    const auto stage = timer.stage("touched");
    blocks_.cache.count_touched(rays_, false);
  }
  {
    const auto stage = timer.stage("group");
    group_(blocks_.cache, rays_);
  }
  {
    const auto stage = timer.stage("intersect");
    intersect_(blocks_.cache, group_.groups(), rays_);
  }
  {
    const auto stage = timer.stage("composite");
    composite_(blocks_.cache, rays_, compaction_);
  }
}

}  // namespace isowave::core
