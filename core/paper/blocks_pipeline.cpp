#include "core/paper/blocks_pipeline.hpp"

#include "core/paper/composite.hpp"
#include "core/paper/initial_rays.hpp"
#include "core/paper/intersect.hpp"
#include "core/paper/speculation.hpp"
#include "core/paper/traverse.hpp"
#include "core/render/block_store.hpp"
#include "core/render/wave.hpp"

namespace isowave::core {

namespace {

class BlocksWave : public Wave {
 public:
  /// blocks, rays: must outlive the wave.
  BlocksWave(BlockStore &blocks, Wavefront &rays, const Group::Limits &limits, Solver solver,
             const BlocksOptions &options)
      : blocks_(blocks),
        rays_(rays),
        scanned_pairs_(options.scanned_pairs),
        compaction_(blocks.device, limits.num_rays, limits.group_size),
        initial_rays_(blocks.device, limits.num_rays),
        speculation_(blocks.device),
        traverse_(blocks.device, limits.num_rays, limits.group_size, options.scanned_pairs),
        group_(blocks.device, limits, options.closest),
        intersect_(blocks.device, limits.num_rays, limits.group_size, solver, options.closest,
                   blocks.cache.slot_type),
        composite_(blocks.device, limits.num_rays, options.closest, blocks.cache.slot_type) {
    blocks.on_resize = [this](std::uint32_t num_slots) { group_.resize(num_slots); };
  }
  BlocksWave(const BlocksWave &) = delete;
  BlocksWave &operator=(const BlocksWave &) = delete;
  ~BlocksWave() override { blocks_.on_resize = {}; }

  void begin() override;
  void enqueue_pass() override;
  void describe(PassStats &stats) const override {
    set_n_spec(stats, stats.counts.active_count);
    stats.visible_blocks = stats.counts.visible_count;
  }

 private:
  BlockStore &blocks_;
  Wavefront &rays_;
  bool scanned_pairs_;
  Compaction compaction_;
  InitialRays initial_rays_;
  Speculation speculation_;
  Traverse traverse_;
  Group group_;
  Intersect intersect_;
  Composite composite_;
};

void BlocksWave::begin() {
  if (scanned_pairs_) {
    rays_.frame.schedule.scanned_pairs = 1;
    rays_.frame.schedule.per_ray_speculation = 0;
  }
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

class BlocksPipeline : public Pipeline {
 public:
  explicit BlocksPipeline(const BlocksOptions &options) : options_(options) {}

  std::string_view name() const override { return "blocks"; }
  bool has_levels() const override { return false; }
  void add_to(Wavefront::Limits &limits) const override {
    limits.with_pairs = true;
    limits.scanned_pairs = options_.scanned_pairs;
  }
  ocl::BufferSizes sizes(const WaveLimits &limits) const override {
    return Compaction::sizes(limits.num_rays, limits.group_size)
        .add(Traverse::sizes(limits.num_rays, limits.group_size, options_.scanned_pairs))
        .add(Group::sizes(group_limits(limits)));
  }
  std::unique_ptr<Wave> make_wave(BlockStore &blocks, Wavefront &rays, const WaveLimits &limits,
                                  const RendererOptions &options) const override {
    return std::make_unique<BlocksWave>(blocks, rays, group_limits(limits), options.solver,
                                        options_);
  }
  const BlocksOptions &options() const { return options_; }

 private:
  Group::Limits group_limits(const WaveLimits &limits) const {
    return {limits.num_rays, limits.num_slots, limits.group_size, options_.grouping};
  }

  BlocksOptions options_;
};

}  // namespace

PipelinePtr blocks_pipeline(const BlocksOptions &options) {
  return std::make_shared<BlocksPipeline>(options);
}

const BlocksOptions *blocks_options(const Pipeline &pipeline) {
  const auto *blocks = dynamic_cast<const BlocksPipeline *>(&pipeline);
  return blocks != nullptr ? &blocks->options() : nullptr;
}

}  // namespace isowave::core
