#include "core/render/pipeline.hpp"

#include "core/stages/composite.hpp"
#include "core/stages/group.hpp"
#include "core/stages/initial_rays.hpp"
#include "core/stages/intersect.hpp"
#include "core/stages/march.hpp"
#include "core/stages/march_packets.hpp"
#include "core/stages/request_ahead.hpp"
#include "core/stages/speculation.hpp"
#include "core/stages/start_rays.hpp"
#include "core/stages/traverse.hpp"

namespace isowave::core {

namespace {

class BlocksPipeline : public Pipeline {
 public:
  BlocksPipeline(FrameState &state, const Group::Limits &limits, Solver solver, ClosestHit closest)
      : state_(state),
        compaction_(state.device, limits.num_rays, limits.group_size),
        initial_rays_(state.device, limits.num_rays),
        speculation_(state.device),
        traverse_(state.device, limits.num_rays, limits.group_size,
                  state.rays.pair_rays.size() != 0),
        group_(state.device, limits, closest),
        intersect_(state.device, limits.num_rays, limits.group_size, solver, closest),
        composite_(state.device, limits.num_rays, closest) {}

  static ocl::BufferSizes sizes(const Group::Limits &limits, bool scanned_pairs) {
    return Compaction::sizes(limits.num_rays, limits.group_size)
        .add(Traverse::sizes(limits.num_rays, limits.group_size, scanned_pairs))
        .add(Group::sizes(limits));
  }

  void begin_frame() override {
    const auto stage = state_.device.timer().stage("initial_rays");
    initial_rays_(state_.rays, compaction_);
  }

  void enqueue_pass() override {
    ocl::StageTimer &timer = state_.device.timer();
    const auto pass = timer.stage("speculation");
    speculation_.begin_pass(state_.rays);
    {
      const auto stage = timer.stage("traverse");
      traverse_(state_.levels[0].macrocells, state_.rays);
    }
    {
      const auto stage = timer.stage("request");
      state_.cache.request(state_.rays);
    }
    state_.provide_blocks(state_.rays.counts, state_.drawing);
    if (state_.counts_touched) {
      const auto stage = timer.stage("touched");
      state_.cache.count_touched(state_.rays, false);
    }
    {
      const auto stage = timer.stage("group");
      group_(state_.cache, state_.rays);
    }
    {
      const auto stage = timer.stage("intersect");
      intersect_(state_.cache, group_.groups(), state_.rays);
    }
    {
      const auto stage = timer.stage("composite");
      composite_(state_.cache, state_.rays, compaction_);
    }
  }

  void resize_cache(std::uint32_t num_slots) override { group_.resize(num_slots); }

 private:
  FrameState &state_;
  Compaction compaction_;
  InitialRays initial_rays_;
  Speculation speculation_;
  Traverse traverse_;
  Group group_;
  Intersect intersect_;
  Composite composite_;
};

class RaysPipeline : public Pipeline {
 public:
  RaysPipeline(FrameState &state, std::uint32_t group_size, Solver solver, RaySource source,
               RayPackets packets, DecodeOnDemand on_demand)
      : state_(state),
        start_rays_(state.device, state.rays.num_rays, group_size, has_levels(state), source),
        march_(state.device, state.rays.num_rays, group_size, solver, has_levels(state), source),
        request_ahead_(state.device, state.rays.num_rays, group_size, has_levels(state), source) {
    const ocl::DeviceInfo &device = state.device.info();
    const bool in_packets =
        packets == RayPackets::kAuto ? MarchPackets::suits(device) : packets == RayPackets::kOn;
    const bool decodes = on_demand == DecodeOnDemand::kAuto ? MarchPackets::may_decode(device)
                                                            : on_demand == DecodeOnDemand::kOn;
    const DeviceStream &stream = state.levels[0].stream;
    if (in_packets && MarchPackets::has(solver) && source == RaySource::kCamera) {
      march_packets_.emplace(state.device, state.rays.num_rays, solver,
                             decodes && !stream.window ? &stream : nullptr);
    }
  }

  void begin_frame() override {
    const auto stage = state_.device.timer().stage("start_rays");
    if (unanswered_) state_.rays.forget_rays();
    if (in_packets()) {
      march_packets_->begin_frame();
    } else {
      start_rays_(macrocells(), state_.rays);
    }
  }

  void enqueue_pass() override {
    Wavefront &rays = state_.rays;
    rays.open_pass();
    if (unanswered_) state_.provide_blocks(rays.previous_counts, asked_);
    {
      const auto stage = state_.device.timer().stage("march");
      if (in_packets()) {
        (*march_packets_)(macrocells(), state_.levels[0].stream, state_.cache, rays);
      } else {
        march_(macrocells(), state_.cache, rays);
      }
    }
    if (state_.counts_touched) {  // before more blocks are stamped, as needed
      const auto stage = state_.device.timer().stage("touched");
      state_.cache.count_touched(rays, true);
    }
    const auto stage = state_.device.timer().stage("request");
    request_ahead_(macrocells(), state_.cache, rays);
    unanswered_ = true;
    asked_ = state_.drawing;
  }

  void end_frame() override { unanswered_ = false; }

 private:
  static bool has_levels(const FrameState &state) { return state.levels.size() > 1; }
  const Macrocells &macrocells() const { return state_.levels[0].macrocells; }
  /// Of the frame at work.
  bool in_packets() const { return march_packets_ && !draws_levels(state_.rays); }

  FrameState &state_;
  StartRays start_rays_;
  March march_;
  std::optional<MarchPackets> march_packets_;  ///< instead of both
  RequestAhead request_ahead_;
  bool unanswered_ = false;  ///< the last pass may have asked for blocks, and left rays
  LevelRange asked_;         ///< of these levels
};

}  // namespace

std::string_view to_string(PipelineKind kind) {
  return kind == PipelineKind::kBlocks ? "blocks" : "rays";
}

ocl::BufferSizes pipeline_sizes(PipelineKind kind, const Group::Limits &limits,
                                bool scanned_pairs) {
  return kind == PipelineKind::kBlocks ? BlocksPipeline::sizes(limits, scanned_pairs)
                                       : ocl::BufferSizes();
}

void FrameState::provide_blocks(const CountsBuffer &asked, LevelRange of) {
  {
    const auto stage = device.timer().stage("cache");
    if (slots_are_scarce) cache.evict(asked, rays);
    cache.assign(asked, rays);
  }
  const auto stage = device.timer().stage("decode");
  try {
    for (std::size_t i = of.first; i < of.end; ++i) {
      Level &level = levels[i];
      // Two in one launch: it takes as long as one block, mostly.
      if (i + 1 < of.end && level.decode.can_join(levels[i + 1].stream)) ++i;
      level.decode({level.stream, level.frame}, {levels[i].stream, levels[i].frame}, rays.counts,
                   cache);
    }
  } catch (...) {  // blocks have slots, but no values, and nobody opens the next pass
    cache.clear();
    rays.reset_counts();
    throw;
  }
}

void FrameState::resize_cache(const BlockCache::Limits &limits) {
  cache.resize(limits);
  for (Level &level : levels) level.decode.resize(limits.max_requests());
  rays.reset_counts();
  slots_are_scarce = true;
}

std::unique_ptr<Pipeline> make_pipeline(PipelineKind kind, FrameState &state,
                                        const Group::Limits &limits, Solver solver,
                                        ClosestHit closest, RayPackets packets,
                                        DecodeOnDemand on_demand) {
  if (kind == PipelineKind::kBlocks)
    return std::make_unique<BlocksPipeline>(state, limits, solver, closest);
  return std::make_unique<RaysPipeline>(state, limits.group_size, solver, RaySource::kCamera,
                                        packets, on_demand);
}

std::unique_ptr<Pipeline> make_given_pipeline(FrameState &state, std::uint32_t group_size,
                                              Solver solver) {
  return std::make_unique<RaysPipeline>(state, group_size, solver, RaySource::kGiven,
                                        RayPackets::kOff, DecodeOnDemand::kOff);
}

}  // namespace isowave::core
