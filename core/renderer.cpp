#include "core/renderer.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

#include "core/error.hpp"
#include "core/stall_guard.hpp"
#include "kernels_cl/block_grid.h"

namespace isowave {

namespace {

/// Slots; below, slots may run out within one pass.
constexpr std::uint32_t kSmallCache = 1u << 16;

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
  if (options.max_speculation < 1 || options.max_speculation > ISO_MAX_SPECULATION) {
    throw Error("a speculation limit of {} is out of range: 1 to {}", options.max_speculation,
                ISO_MAX_SPECULATION);
  }
  // Measured faster by a CPU and by a GPU, in all cases but one (README "Results").
  if (options.pipeline == PipelineKind::kAuto) options.pipeline = PipelineKind::kRays;
  const std::uint32_t largest = std::min(256u, device.capabilities().max_work_group_size);
  if (!std::has_single_bit(options.group_size) || options.group_size < 8 || options.group_size > largest) {
    throw Error("a work-group size of {} cannot be used on {}: a power of two from 8 to {} can",
                options.group_size, device.info().name, largest);
  }
  if (options.window_blocks != 0 && options.window_blocks < kMinCacheSlots) {
    throw Error("a window of {} blocks cannot be used: {} (one dual grid) and more can",
                options.window_blocks, kMinCacheSlots);
  }
  if (options.largest_stream_part == 0) {
    options.largest_stream_part = device.capabilities().largest_allocation;
  }
  return options;
}

/// All memory, before any is taken.
MemoryPlan make_plan(const ocl::Device &device, const CompressedVolume &volume,
                     const RendererOptions &options) {
  const MemoryRequest request{options.size.num_pixels(), options.pipeline, options.grouping,
                              options.group_size,        options.stream,   options.largest_stream_part,
                              options.window_blocks};
  const std::uint64_t budget =
      options.memory_budget != 0 ? options.memory_budget : device.capabilities().global_memory / 4 * 3;
  const std::uint64_t all = std::max<std::uint64_t>(volume.block_count(), kMinCacheSlots);
  if (options.cache_slots != 0) {
    MemoryPlan plan = plan_with_slots(volume, request, budget, options.cache_slots);
    if (options.memory_budget != 0 && plan.peak() > budget) {
      throw Error(
          "{} cache slots need {} bytes of device memory, more than the budget of {}: give one of the two "
          "alone",
          options.cache_slots, plan.peak(), budget);
    }
    return plan;
  }
  const std::uint64_t most =
      options.memory_budget != 0 ? std::uint64_t{ISO_MAX_CACHE_SLOTS} : kAmpleCacheSlots;
  return plan_within(device, volume, request, budget, static_cast<std::uint32_t>(std::min(all, most)));
}

FrameState make_state(ocl::Device &device, const CompressedVolume &volume, const RendererOptions &options,
                      const MemoryPlan &plan) {
  const FrameParams grid = make_grid_params(volume.info);
  DeviceStream stream = plan.stream == StreamPlace::kHost
                            ? DeviceStream(device, volume, OnHost{plan.window_blocks})
                            : DeviceStream(device, volume, options.largest_stream_part);
  Wavefront rays(device, options.size.num_pixels(), options.pipeline == PipelineKind::kBlocks);
  Macrocells macrocells(device, grid, stream);
  ZfpDecode decode(device, plan.cache_slots, stream.defines());
  BlockCache cache(device, grid, plan.cache_slots, options.size.num_pixels(), options.group_size);
  return {device,           std::move(stream), std::move(rays), std::move(macrocells),
          std::move(cache), std::move(decode)};
}

}  // namespace

Renderer::Renderer(ocl::Device &device, const CompressedVolume &volume, const RendererOptions &options)
    : device_(device),
      setup_begin_(std::chrono::steady_clock::now()),
      options_(checked(options, volume, device)),
      plan_(make_plan(device, volume, options_)),
      info_(volume.info),
      error_bound_(volume.error_bound),
      state_(make_state(device, volume, options_, plan_)),
      pipeline_(make_pipeline(options_.pipeline, state_, options_.group_size, options_.solver,
                              options_.grouping, options_.closest)),
      shade_(device, options_.size.num_pixels()),
      readback_(device) {
  options_.cache_slots = plan_.cache_slots;
  options_.stream = plan_.stream;
  options_.window_blocks = plan_.window_blocks;
  device.finish();
  setup_ms_ = ms_since(setup_begin_);
}

FrameStats Renderer::render(const Camera &camera, float isovalue, const OnPass &on_pass) {
  const auto begin = std::chrono::steady_clock::now();
  const bool in_step = on_pass || device_.timer().source() != ocl::TimerSource::kOff;
  const StreamWindow *window = state_.stream.window.get();
  const std::uint64_t uploaded_before = window ? window->uploaded_blocks() : 0;
  const std::uint64_t uploaded_bytes_before = window ? window->uploaded_bytes() : 0;
  FrameStats stats;
  StallGuard guard(info_.dims);
  readback_.drain();  // of what the frame before had enqueued beyond its last pass
  begin_frame(camera, isovalue);
  for (bool finished = false; !finished && !stats.cancelled;) {
    pipeline_->enqueue_pass();
    readback_.push(state_.rays.counts);
    if (!in_step && readback_.in_flight() < PassReadback::kMaxInFlight)
      continue;  // read one pass behind: the device never waits for us
    const PassStats pass = stats_of(readback_.pop());
    stats.passes.push_back(pass);
    stats.rays_hit += pass.counts.hit_count;
    stats.cancelled = on_pass && !on_pass(pass);
    finished = pass.counts.next_active_count == 0;
    guard.check(pass.counts);
  }
  // The hits are complete. A pass that is enqueued beyond the last finds no rays, and nobody waits for it.
  if (!stats.cancelled) pipeline_->end_frame();
  if (window) {
    stats.uploaded_blocks = window->uploaded_blocks() - uploaded_before;
    stats.uploaded_bytes = window->uploaded_bytes() - uploaded_bytes_before;
  }
  stats.total_ms = ms_since(begin);
  return stats;
}

void Renderer::begin_frame(const Camera &camera, float isovalue) {
  FrameParams &frame = state_.rays.frame;
  frame = make_frame_params(info_, camera, options_.size, isovalue);
  frame.max_spec_count = options_.max_speculation;
  frame.per_ray_speculation = options_.per_ray_speculation;
  frame.table_groups = state_.cache.table_groups;
  if (selected_isovalue_ != isovalue) {
    const auto stage = device_.timer().stage("macrocells");
    state_.macrocells.select(frame, value_error_);
    state_.cache.classify(state_.rays);
  }
  state_.macrocells.set_active_box(frame);
  selected_isovalue_ = isovalue;
  pipeline_->begin_frame();
}

PassStats Renderer::stats_of(const PassCounts &counts) {
  const double pixels = static_cast<double>(state_.rays.num_pixels);
  PassStats stats;
  stats.counts = counts;
  stats.counts.window_count = std::min(counts.window_count, counts.active_count);
  // A launch that is not needed costs more than a pass that finds slots missing now and then.
  state_.slots_are_scarce =
      state_.cache.num_slots < kSmallCache || counts.free_count < state_.cache.num_slots / 4;
  stats.utilization_percent = 100.0 * counts.granted_count / pixels;
  stats.completed_percent = 100.0 * (pixels - counts.next_active_count) / pixels;
  stats.stage_ms = device_.timer().collect();
  return stats;
}

void Renderer::set_value_error(double value_error) {
  const ErrorBound bound = coarser(error_bound_, value_error);
  StreamLayout &layout = state_.stream.layout;
  if (layout.min_exponent == bound.min_exponent) return;
  const bool all_planes = bound.min_exponent == error_bound_.min_exponent;
  layout.min_exponent = bound.min_exponent;
  layout.whole_numbers = bound.whole_numbers ? 1 : 0;
  // Ranges were made of rounded values, and fewer planes are not rounded.
  const double unrounded = error_bound_.whole_numbers ? 0.5 : 0.0;
  value_error_ = all_planes ? 0.0f : static_cast<float>(std::ldexp(1.0, bound.min_exponent) + unrounded);
  selected_isovalue_.reset();
  clear_cache();
}

void Renderer::clear_cache() {
  state_.cache.clear();
  device_.finish();
}

Image8 Renderer::shade(const Appearance &appearance) {
  return shade_(make_shade_params(info_, appearance), state_.rays);
}

}  // namespace isowave
