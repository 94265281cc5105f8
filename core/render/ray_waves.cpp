#include "core/render/ray_waves.hpp"

#include <utility>
#include <vector>

#include "core/frame/field_values.hpp"

namespace isowave::core {

RaysWave::RaysWave(BlockStore &blocks, Wavefront &rays, std::uint32_t group_size, Solver solver,
                   RaySource source, RayPackets packets, DecodeOnDemand on_demand)
    : blocks_(blocks),
      rays_(rays),
      start_rays_(blocks.device, rays.num_rays, group_size, blocks.levels.size() > 1, source,
                  blocks.cache.slot_type),
      march_(blocks.device, rays.num_rays, group_size, solver, blocks.levels.size() > 1, source,
             blocks.cache.slot_type),
      request_ahead_(blocks.device, rays.num_rays, group_size, blocks.levels.size() > 1, source) {
  const ocl::DeviceInfo &device = blocks.device.info();
  const bool in_packets =
      packets == RayPackets::kAuto ? MarchPackets::suits(device) : packets == RayPackets::kOn;
  const bool decodes = on_demand == DecodeOnDemand::kAuto ? MarchPackets::may_decode(device)
                                                          : on_demand == DecodeOnDemand::kOn;
  const DeviceStream &stream = blocks.levels[0].stream;
  if (device.type == ocl::DeviceType::kGpu && source == RaySource::kCamera &&
      blocks.levels.size() == 1)
    start_and_march_.emplace(blocks.device, rays.num_rays, group_size, solver,
                             blocks.cache.slot_type);
  if (in_packets && MarchPackets::has(solver) && source == RaySource::kCamera) {
    march_packets_.emplace(blocks.device, rays.num_rays, solver,
                           decodes && !stream.window ? &stream : nullptr, blocks.cache.slot_type);
    bands_in_packets_ = decodes && !stream.window && blocks.levels[0].info.brick == BrickOf{};
  }
}

void RaysWave::start(bool begins_frame) {
  const auto stage = blocks_.device.timer().stage("start_rays");
  if (blocks_.has_requests()) rays_.forget_rays();
  starts_and_marches_ = begins_frame && start_and_march_ && !in_packets() &&
                        blocks_.has_drawn_surface && !has_bands();
  if (in_packets()) {
    march_packets_->begin_frame();
  } else if (!starts_and_marches_) {
    start_rays_(macrocells(), rays_, begins_frame);
  }
}

void RaysWave::march() {
  if (in_packets() && !has_bands()) {
    (*march_packets_)(macrocells(), blocks_.levels[0].stream, blocks_.cache, rays_);
  } else if (in_packets() && march_packets_->begins()) {
    std::vector<MarchPackets::Band> bands;
    for (std::size_t i = blocks_.drawing.first; i < blocks_.drawing.end; ++i)
      bands.push_back({blocks_.levels[i].stream, blocks_.levels[i].frame});
    (*march_packets_)(macrocells(), bands, blocks_.cache, rays_);
  } else if (std::exchange(starts_and_marches_, false)) {
    (*start_and_march_)(macrocells(), blocks_.cache, rays_);
  } else {
    march_(macrocells(), blocks_.cache, rays_);
  }
}

void RaysWave::enqueue_pass() {
  ocl::StageTimer &timer = blocks_.device.timer();
  rays_.open_pass();
  blocks_.provide(rays_);
  {
    const auto stage = timer.stage("march");
    march();
  }
  if (blocks_.counts_touched) {  // before more blocks are stamped, as needed
    const auto stage = timer.stage("touched");
    blocks_.cache.count_touched(rays_, true);
  }
  const auto stage = timer.stage("request");
  request_ahead_(macrocells(), blocks_.cache, rays_);
  blocks_.expect_requests();
}

BehindWave::BehindWave(BlockStore &blocks, Wavefront &rays, Layers &layers,
                       std::uint32_t group_size, Solver solver)
    : blocks_(blocks),
      rays_(rays),
      layers_(layers),
      march_(blocks.device, rays.num_rays, group_size, solver, blocks.levels.size() > 1,
             RaySource::kBehindHits, blocks.cache.slot_type),
      request_ahead_(blocks.device, rays.num_rays, group_size, blocks.levels.size() > 1,
                     RaySource::kBehindHits) {}

void BehindWave::begin() {
  const auto stage = blocks_.device.timer().stage("start_rays");
  if (blocks_.has_requests()) rays_.forget_rays();
  layers_.begin(rays_, is_first_layer_ ? rays_.hits : layers_.further_hits(), place_);
  layers_.swap_hits(rays_, place_);
}

void BehindWave::enqueue_pass() {
  ocl::StageTimer &timer = blocks_.device.timer();
  rays_.open_pass();
  blocks_.provide(rays_);
  {
    const auto stage = timer.stage("march");
    march_(blocks_.levels[0].macrocells, blocks_.cache, rays_);
  }
  const auto stage = timer.stage("request");
  request_ahead_(blocks_.levels[0].macrocells, blocks_.cache, rays_);
  blocks_.expect_requests();
}

void SmoothNormalsWave::enqueue_pass() {
  rays_.open_pass();
  if (!begins_) blocks_.provide(rays_);
  const auto stage = blocks_.device.timer().stage("normals");
  normals_(blocks_.cache, rays_, begins_, source_);
  begins_ = false;
  blocks_.expect_requests();
}

void LayerNormalsWave::begin() {
  const auto stage = blocks_.device.timer().stage("normals");
  if (blocks_.has_requests()) rays_.forget_rays();
  layers_.begin(rays_, rays_.hits);
}

void SliceValuesWave::set_layer(bool is_first, uint surfaces) {
  is_first_layer_ = is_first;
  std::vector<FieldMap> maps = make_own_maps(infos_of(blocks_.levels));
  for (FieldMap &map : maps) map.surfaces = surfaces;
  const auto first = maps.begin() + std::ptrdiff_t(blocks_.drawing.first);
  values_.set_maps({first, first + std::ptrdiff_t(blocks_.drawing.end - blocks_.drawing.first)});
}

void SliceValuesWave::begin() {
  begins_ = is_first_layer_;
  if (is_first_layer_) return;
  const auto stage = blocks_.device.timer().stage("field");
  if (blocks_.has_requests()) rays_.forget_rays();
  layers_.begin(rays_, rays_.hits);
}

void SliceValuesWave::enqueue_pass() {
  rays_.open_pass();
  if (!begins_) blocks_.provide(rays_);
  const auto stage = blocks_.device.timer().stage("field");
  values_(rays_.frame, blocks_.cache, rays_, begins_);
  begins_ = false;
  blocks_.expect_requests();
}

void AmbientRound::begin() {
  if (!goes_on_) {
    const auto stage = blocks_.device.timer().stage("ambient");
    ambient_(rays_, round_);
  }
  if (enters_) {
    const auto stage = blocks_.device.timer().stage("ambient");
    ambient_.enter(rays_, nearest_);
  }
  given_.go_on();
}

namespace {

class RaysPipeline : public Pipeline {
 public:
  std::string_view name() const override { return "rays"; }
  bool has_levels() const override { return true; }
  bool has_clipping() const override { return true; }
  void add_to(Wavefront::Limits & /*limits*/) const override {}
  ocl::BufferSizes sizes(const WaveLimits & /*limits*/) const override { return {}; }
  std::unique_ptr<Wave> make_wave(BlockStore &blocks, Wavefront &rays, const WaveLimits &limits,
                                  const RendererOptions &options) const override {
    return std::make_unique<RaysWave>(blocks, rays, limits.group_size, options.solver,
                                      RaySource::kCamera, options.packets, options.on_demand);
  }
};

}  // namespace

PipelinePtr rays_pipeline() {
  static const auto pipeline = std::make_shared<const RaysPipeline>();
  return pipeline;
}

}  // namespace isowave::core
