#include "core/pipeline.hpp"

#include <stdexcept>
#include <utility>

#include "core/composite.hpp"
#include "core/group.hpp"
#include "core/initial_rays.hpp"
#include "core/intersect.hpp"
#include "core/march.hpp"
#include "core/speculation.hpp"
#include "core/traverse.hpp"

namespace isowave {

namespace {

class BlocksPipeline : public Pipeline {
 public:
  BlocksPipeline(FrameState &state, std::uint32_t group_size, Solver solver, Grouping grouping,
                 ClosestHit closest)
      : state_(state),
        compaction_(state.device, state.rays.num_pixels, group_size),
        initial_rays_(state.device, state.rays.num_pixels),
        speculation_(state.device),
        traverse_(state.device, state.rays.num_pixels, group_size),
        group_(state.device, state.rays.num_pixels, state.cache.num_slots, group_size, grouping, closest),
        intersect_(state.device, state.rays.num_pixels, group_size, solver, closest),
        composite_(state.device, state.rays.num_pixels, closest) {}

  void begin_frame() override {
    const auto stage = state_.device.timer().stage("initial_rays");
    initial_rays_(state_.rays, compaction_);
  }
  void begin_band(const Level &) override {
    throw std::logic_error("pipeline blocks: a frame has one band");  // the renderer sees to it
  }

  void enqueue_pass() override {
    ocl::StageTimer &timer = state_.device.timer();
    const auto pass = timer.stage("speculation");
    speculation_.begin_pass(state_.rays);
    {
      const auto stage = timer.stage("traverse");
      traverse_(state_.level().macrocells, state_.rays);
    }
    {
      const auto stage = timer.stage("request");
      state_.cache.request(state_.rays);
    }
    state_.provide_blocks(state_.rays.counts, state_.level());
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
  RaysPipeline(FrameState &state, std::uint32_t group_size, Solver solver)
      : state_(state),
        march_(state.device, state.rays.num_pixels, group_size, solver, state.levels.size() > 1) {}

  void begin_frame() override {
    const auto stage = state_.device.timer().stage("start_rays");
    if (unanswered_) state_.rays.forget_rays();
    march_.start_rays(state_.level().macrocells, state_.rays);
  }
  void begin_band(const Level &before) override {
    const auto stage = state_.device.timer().stage("cross_border");
    march_.cross_border(before.frame, before.macrocells, state_.level().macrocells, state_.rays);
  }

  void enqueue_pass() override {
    Wavefront &rays = state_.rays;
    rays.open_pass();
    if (unanswered_) state_.provide_blocks(rays.previous_counts, *asked_);
    {
      const auto stage = state_.device.timer().stage("march");
      march_(state_.level().macrocells, state_.cache, rays);
    }
    const auto stage = state_.device.timer().stage("request");
    march_.request_ahead(state_.level().macrocells, state_.cache, rays);
    unanswered_ = true;
    asked_ = &state_.level();
  }

  void end_band() override { unanswered_ = false; }

 private:
  FrameState &state_;
  March march_;
  bool unanswered_ = false;  ///< the last pass may have asked for blocks, and left rays
  Level *asked_ = nullptr;   ///< whose blocks
};

}  // namespace

std::string_view to_string(PipelineKind kind) {
  return kind == PipelineKind::kBlocks ? "blocks" : "rays";
}

void FrameState::provide_blocks(const CountsBuffer &asked, Level &of) {
  const FrameParams frame =
      std::exchange(rays.frame, of.frame);  // a cancelled frame's last band asked, perhaps
  {
    const auto stage = device.timer().stage("cache");
    if (slots_are_scarce) cache.evict(asked, rays);
    cache.assign(asked, rays);
  }
  const auto stage = device.timer().stage("decode");
  try {
    of.decode(of.stream, rays.frame, rays.counts, cache);
  } catch (...) {  // blocks have slots, but no values
    cache.clear();
    throw;
  }
  rays.frame = frame;
}

std::unique_ptr<Pipeline> make_pipeline(PipelineKind kind, FrameState &state, std::uint32_t group_size,
                                        Solver solver, Grouping grouping, ClosestHit closest) {
  if (kind == PipelineKind::kBlocks)
    return std::make_unique<BlocksPipeline>(state, group_size, solver, grouping, closest);
  return std::make_unique<RaysPipeline>(state, group_size, solver);
}

}  // namespace isowave
