#include "core/renderer.hpp"

#include <algorithm>
#include <bit>
#include <chrono>

#include "core/error.hpp"
#include "core/pass_readback.hpp"
#include "kernels_cl/block_grid.h"

namespace isowave {

namespace {

double ms_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

RendererOptions checked(RendererOptions options, const CompressedVolume &volume, const ocl::Device &device) {
  check_volume_info(volume.info, "the volume");
  check_image_size(options.size);
  if (volume.block_count() >= ISO_MAX_CACHE_SLOTS) {
    throw Error("a volume of {} blocks cannot be drawn: block ids end at {}", volume.block_count(),
                ISO_MAX_CACHE_SLOTS);
  }
  if (options.cache_slots == 0) options.cache_slots = default_cache_slots(volume);
  if (options.max_speculation < 1 || options.max_speculation > ISO_MAX_SPECULATION) {
    throw Error("a speculation limit of {} is out of range: 1 to {}", options.max_speculation,
                ISO_MAX_SPECULATION);
  }
  const std::uint32_t largest = std::min(256u, device.capabilities().max_work_group_size);
  if (!std::has_single_bit(options.group_size) || options.group_size < 8 || options.group_size > largest) {
    throw Error("a work-group size of {} cannot be used on {}: a power of two from 8 to {} can",
                options.group_size, device.info().name, largest);
  }
  return options;
}

/// Grid constants for the work that is done before there is a camera.
FrameParams grid_params(const CompressedVolume &volume) {
  FrameParams frame{};
  const glm::uvec3 blocks = volume.num_blocks();
  frame.dims_x = volume.info.dims.x;
  frame.dims_y = volume.info.dims.y;
  frame.dims_z = volume.info.dims.z;
  frame.blocks_x = blocks.x;
  frame.blocks_y = blocks.y;
  frame.blocks_z = blocks.z;
  return frame;
}

}  // namespace

std::uint32_t default_cache_slots(const CompressedVolume &volume) {
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(volume.block_count(), kMinCacheSlots, 1u << 18));
}

Renderer::Renderer(ocl::Device &device, const CompressedVolume &volume, const RendererOptions &options)
    : device_(device),
      setup_begin_(std::chrono::steady_clock::now()),
      options_(checked(options, volume, device)),
      info_(volume.info),
      stream_(device, volume),
      rays_(device, options_.size.num_pixels()),
      macrocells_(device, rays_.frame, grid_params(volume), stream_.words, stream_.bits_per_block),
      cache_(device, volume.block_count(), options_.cache_slots, rays_.num_pixels, options_.group_size),
      compaction_(device, rays_.num_pixels, options_.group_size),
      initial_rays_(device, rays_.num_pixels),
      speculation_(device),
      traverse_(device, rays_.num_pixels, options_.group_size),
      zfp_decode_(device, options_.cache_slots),
      group_(device, rays_.num_pixels, options_.cache_slots, options_.group_size, options_.grouping),
      intersect_(device, rays_.num_pixels, options_.group_size, options_.solver),
      composite_(device, rays_.num_pixels),
      shade_(device, rays_.num_pixels) {
  device.finish();
  setup_ms_ = ms_since(setup_begin_);
}

FrameStats Renderer::render(const Camera &camera, float isovalue, const OnPass &on_pass) {
  const auto begin = std::chrono::steady_clock::now();
  const bool in_step = on_pass || device_.timer().source() != ocl::TimerSource::kOff;
  FrameStats stats;
  PassReadback readback;
  begin_frame(camera, isovalue);
  for (bool finished = false; !finished && !stats.cancelled;) {
    enqueue_pass();
    readback.push(rays_.counts);
    if (!in_step && readback.in_flight() < 2)
      continue;  // read one pass behind: the device never waits for us
    const PassStats pass = stats_of(readback.pop());
    stats.passes.push_back(pass);
    stats.rays_hit += pass.counts.hit_count;
    stats.cancelled = on_pass && !on_pass(pass);
    finished = pass.counts.next_active_count == 0;
  }
  device_.finish();
  stats.total_ms = ms_since(begin);
  return stats;
}

void Renderer::begin_frame(const Camera &camera, float isovalue) {
  const auto stage = device_.timer().stage("initial_rays");
  frame_ = make_frame_params(info_, camera, options_.size, isovalue);
  frame_.isovalue_index = macrocells_.isovalue_index(isovalue);
  frame_.max_spec_count = options_.max_speculation;
  rays_.frame.write({&frame_, 1});
  if (selected_isovalue_ != isovalue) macrocells_.select(rays_.frame);
  selected_isovalue_ = isovalue;
  initial_rays_(rays_, compaction_);
}

/// One pass (Sec. 3.3 to 4.4): a chain of launches whose sizes live on the device.
void Renderer::enqueue_pass() {
  ocl::StageTimer &timer = device_.timer();
  const auto pass = timer.stage("speculation");
  speculation_.begin_pass(rays_);
  {
    const auto stage = timer.stage("traverse");
    traverse_(macrocells_, rays_);
  }
  {
    const auto stage = timer.stage("request");
    cache_.request(rays_);
  }
  {
    const auto stage = timer.stage("cache");
    cache_.assign_slots(rays_);
  }
  {
    const auto stage = timer.stage("decode");
    zfp_decode_(stream_, rays_.counts, cache_.decode_block_ids(), cache_.decode_slots(), cache_.values());
  }
  {
    const auto stage = timer.stage("group");
    group_(cache_, rays_, compaction_);
  }
  {
    const auto stage = timer.stage("intersect");
    intersect_(cache_, group_.groups(), rays_);
  }
  {
    const auto stage = timer.stage("composite");
    composite_(cache_, rays_, compaction_);
  }
}

PassStats Renderer::stats_of(const PassCounts &counts) {
  const double pixels = static_cast<double>(rays_.num_pixels);
  PassStats stats;
  stats.counts = counts;
  stats.utilization_percent = 100.0 * counts.granted_count / pixels;
  stats.completed_percent = 100.0 * (pixels - counts.next_active_count) / pixels;
  stats.stage_ms = device_.timer().collect();
  return stats;
}

void Renderer::clear_cache() {
  cache_.clear();
  device_.finish();
}

Image8 Renderer::shade(const Appearance &appearance) {
  return shade_(frame_, make_shade_params(info_, appearance), rays_);
}

}  // namespace isowave
