#include "core/render/renderer.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "core/base/error.hpp"
#include "core/render/stall_guard.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

/// Slots; below, slots may run out within one pass.
constexpr std::uint32_t kSmallCache = 1u << 16;

double ms_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

RendererOptions checked(RendererOptions options, const CompressedVolume &volume,
                        const ocl::Device &device) {
  check_volume_info(volume.info, "the volume");
  check_image_size(options.size);
  check_levels(volume, options.voxel_pixels);
  const bool with_levels = options.voxel_pixels > 0;
  if (with_levels && options.pipeline == PipelineKind::kBlocks)
    throw Error(
        "pipeline blocks draws one level of detail: leave it to pipeline rays, or allow 0 pixels");
  const std::uint64_t layer_ids = std::uint64_t{volume.num_blocks().x} * volume.num_blocks().y;
  std::uint64_t num_ids = 0;  // see make_id_grid()
  for (const CompressedVolume *level : levels_of(volume, with_levels))
    num_ids += layer_ids * level->num_blocks().z;
  if (num_ids >= ISO_MAX_BLOCK_IDS) {
    throw Error("a volume of {} blocks cannot be drawn: block ids end at {}", num_ids,
                ISO_MAX_BLOCK_IDS);
  }
  if (options.max_speculation < 1 || options.max_speculation > ISO_MAX_SPECULATION) {
    throw Error("a speculation limit of {} is out of range: 1 to {}", options.max_speculation,
                ISO_MAX_SPECULATION);
  }
  if (options.pipeline == PipelineKind::kAuto) options.pipeline = PipelineKind::kRays;
  const std::uint32_t largest = std::min(256u, device.capabilities().max_work_group_size);
  if (!std::has_single_bit(options.group_size) || options.group_size < 8 ||
      options.group_size > largest) {
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
  const MemoryRequest request{
      options.size.num_rays(), options.pipeline,
      options.grouping,        options.group_size,
      options.stream,          options.largest_stream_part,
      options.window_blocks,   options.voxel_pixels > 0,
      options.with_bounds,     options.with_kept_picture ? halved(options.size, 1).num_rays() : 0};
  const std::uint64_t budget = options.memory_budget != 0
                                   ? options.memory_budget
                                   : device.capabilities().global_memory / 4 * 3;
  std::uint64_t num_blocks = 0;
  for (const CompressedVolume *level : levels_of(volume, request.with_levels))
    num_blocks += level->block_count();
  if (options.cache_slots != 0) {
    MemoryPlan plan = plan_with_slots(volume, request, budget, options.cache_slots);
    if (options.memory_budget != 0 && plan.peak() > budget) {
      throw Error(
          "{} cache slots need {} bytes of device memory, more than the budget of {}: give one of "
          "the two "
          "alone",
          options.cache_slots, plan.peak(), budget);
    }
    return plan;
  }
  const std::uint64_t most =
      options.memory_budget != 0 ? std::uint64_t{ISO_MAX_CACHE_SLOTS} : kAmpleCacheSlots;
  return plan_within(
      device, volume, request, budget,
      static_cast<std::uint32_t>(std::clamp<std::uint64_t>(num_blocks, kMinCacheSlots, most)));
}

FrameState make_state(ocl::Device &device, const CompressedVolume &volume,
                      const RendererOptions &options, const MemoryPlan &plan) {
  const std::vector<const CompressedVolume *> volumes = levels_of(volume, options.voxel_pixels > 0);
  const std::vector<FrameParams> grids =
      make_level_grids(level_infos(volume, options.voxel_pixels > 0));
  const FrameParams ids = make_id_grid(grids), &last = grids.back();
  const bool has_levels = volumes.size() > 1;
  const auto buffers = std::make_shared<MacrocellBuffers>(
      device, last.ranges_begin + block_count(last), last.masks_begin / 2 + num_macrocells(last),
      options.with_bounds ? kNumFieldBounds : 1);
  const std::uint64_t num_rays = options.size.num_rays();
  const std::uint32_t most_requests =
      BlockCache::capacity_for(plan.cache_slots, block_count(ids), num_rays);
  std::vector<Level> levels;
  for (std::size_t i = 0; i < volumes.size(); ++i) {
    const CompressedVolume &level = *volumes[i];
    DeviceStream stream =
        plan.stream == StreamPlace::kHost
            ? DeviceStream(device, level, OnHost{plan.window_blocks}, options.with_bounds)
            : DeviceStream(device, level, options.largest_stream_part, options.with_bounds);
    Macrocells macrocells(device, grids[i], stream, buffers);
    ZfpDecode decode(device, most_requests, stream.defines(), has_levels);
    levels.push_back({level.info, level.precision, LevelError(level, i == 0), std::move(stream),
                      std::move(macrocells), std::move(decode)});
  }
  Wavefront rays(device, num_rays, options.pipeline == PipelineKind::kBlocks, volumes.size());
  BlockCache cache(device, ids, plan.cache_slots, num_rays, options.group_size, has_levels);
  return {device, std::move(levels), std::move(rays), std::move(cache)};
}

/// A frame that freed more slots than these of blocks that it had asked for leaves nothing of use
/// to the next. What is left of a ray's blocks makes it wait once for each that is gone. To a GPU
/// such passes cost more than decoding all anew: H100, 512^3, frames that come again take 1.2 ms
/// with 90,000 slots, 1.4 with 85,000 and 1.9 with 70,000 where blocks are kept, cold ones 1.3.
/// Where blocks take longer, since a CPU decodes them or they must be uploaded first, more are
/// worth keeping: PoCL, 80,000 and 65,536 slots, 123 and 138 ms, cold 154 and 146.
std::uint32_t most_recycled(std::uint32_t num_slots, ocl::DeviceType type, StreamPlace stream) {
  return num_slots / (type == ocl::DeviceType::kCpu || stream == StreamPlace::kHost ? 2 : 8);
}

bool turned_over(const std::vector<PassStats> &passes, std::uint32_t most) {
  std::uint64_t num_recycled = 0;
  for (const PassStats &pass : passes) num_recycled += pass.counts.recycled_count;
  return num_recycled > most;
}

}  // namespace

Renderer::Renderer(ocl::Device &device, const CompressedVolume &volume,
                   const RendererOptions &options)
    : device_(device),
      setup_begin_(std::chrono::steady_clock::now()),
      compile_ms_before_(device.compile_ms()),
      options_(checked(options, volume, device)),
      plan_(make_plan(device, volume, options_)),
      state_(make_state(device, volume, options_, plan_)),
      value_range_(volume.value_range),
      pipeline_(make_pipeline(options_.pipeline, state_, options_.group_size, options_.solver,
                              options_.grouping, options_.closest)),
      shade_(device, options_.size.num_rays()),
      readback_(device) {
  if (options_.with_kept_picture) kept_.emplace(device, halved(options_.size, 1));
  options_.cache_slots = plan_.cache_slots;
  options_.stream = plan_.stream;
  options_.window_blocks = plan_.window_blocks;
  compile_kernels();
  device.timer().collect();  // what was launched so far belongs to no frame; waits
  device.finish();
  setup_ms_ = ms_since(setup_begin_) - (device.compile_ms() - compile_ms_before_);
}

/// Launches whatever frames will launch. PoCL and Mesa compile a kernel when it is launched first,
/// PoCL for each work-group size, and anew for more than 65,535 work-items. So the passes
/// themselves run, of a frame of one pixel that meets nothing: what is launched here cannot differ
/// from what frames launch, and all kernels leave by the exits they have for empty lists. Costs no
/// time that grows with the volume; all that it leaves is one hit, which every frame clears.
void Renderer::compile_kernels() {
  const auto compiling = device_.compiling();
  Wavefront &rays = state_.rays;
  rays.frame = FrameParams{};
  rays.frame.width = rays.frame.height = rays.frame.max_spec_count = 1;
  rays.frame.table_groups = state_.cache.table_groups;
  // Frames of one level of detail and of several have kernels of their own.
  for (std::uint32_t num_levels = 1; num_levels <= std::min<std::size_t>(2, state_.levels.size());
       ++num_levels) {
    rays.num_level_frames = num_levels;
    pipeline_->begin_frame();
    for (int pass = 0; pass < 2; ++pass)
      pipeline_->enqueue_pass();  // the first has nothing to decode
    pipeline_->end_frame();
  }
  state_.cache.classify(rays);
  for (Level &level : state_.levels) level.decode.compile(level.stream, rays.counts, state_.cache);
  if (options_.with_shading) shade_.compile(rays);
  if (kept_) kept_->compile(rays);
  rays.reset_counts();
}

FrameStats Renderer::render(const Camera &camera, float isovalue, const OnPass &on_pass) {
  const auto begin = std::chrono::steady_clock::now();
  const Uploads uploaded_before = uploads();
  const bool in_step = on_pass || device_.timer().source() != ocl::TimerSource::kOff;
  FrameStats stats;
  begin_frame(camera, isovalue);
  stats.first_level = state_.drawing.first;
  stats.last_level = state_.drawing.end - 1;
  StallGuard guard(state_.levels[0].info.dims);
  for (bool finished = false; !finished && !stats.cancelled;) {
    pipeline_->enqueue_pass();
    readback_.push(state_.rays.counts);
    if (!in_step && readback_.in_flight() < PassReadback::kMaxInFlight)
      continue;  // read one pass behind: the device never waits for us
    const PassStats pass = stats_of(readback_.pop());
    stats.rays_hit += pass.counts.hit_count;
    stats.passes.push_back(pass);
    finished = pass.counts.next_active_count == 0;
    stats.cancelled = on_pass && !on_pass(pass) && !finished;
    guard.check(pass.counts);
  }
  // The hits are complete. A pass that is enqueued beyond the last finds no rays, and nobody waits
  // for it.
  if (!stats.cancelled) {
    pipeline_->end_frame();
    if (turned_over(stats.passes,
                    most_recycled(state_.cache.num_slots, device_.info().type, options_.stream)))
      state_.cache.clear();
  }
  state_.rays.frame = state_.levels[0].frame;  // for shading
  const Uploads uploaded = uploads();
  stats.uploaded_blocks = uploaded.blocks - uploaded_before.blocks;
  stats.uploaded_bytes = uploaded.bytes - uploaded_before.bytes;
  stats.total_ms = ms_since(begin);
  return stats;
}

void Renderer::begin_frame(const Camera &camera, float isovalue) {
  readback_.drain();  // of what the frame before had enqueued beyond its last pass
  std::vector<VolumeInfo> infos;
  for (const Level &level : state_.levels) infos.push_back(level.info);
  std::vector<FrameParams> frames =
      make_level_frames(infos, camera, options_.size, isovalue, options_.voxel_pixels);
  const auto first = std::ranges::find_if(frames, draws);
  const auto end = std::find_if_not(first, frames.end(), draws);
  state_.drawing = {static_cast<std::size_t>(first - frames.begin()),
                    static_cast<std::size_t>(end - frames.begin())};
  const bool has_bands = end - first > 1;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Level &level = state_.levels[i];
    FrameParams &frame = frames[i];
    frame.max_spec_count = options_.max_speculation;
    frame.per_ray_speculation = options_.per_ray_speculation;
    frame.table_groups = state_.cache.table_groups;
    if (draws(frame)) {
      const auto stage = device_.timer().stage("macrocells");
      level.macrocells.select(frame, level.range_error, &level.stream);
      level.macrocells.set_index(frame);
      level.macrocells.set_active_box(frame);
      // Where there are several bands, a ray stands at a border wherever it crosses that.
      if (!has_bands) set_screen_box(frame);
    }
    level.frame = frame;
  }
  level_frames_.assign(first, end);
  state_.rays.frame = level_frames_.front();
  state_.rays.num_level_frames = static_cast<std::uint32_t>(level_frames_.size());
  if (has_levels()) state_.rays.level_frames.write_async(level_frames_);
  if (cached_isovalue_.value_or(isovalue) != isovalue) {
    const auto stage = device_.timer().stage("macrocells");
    state_.cache.classify(state_.rays);
  }
  cached_isovalue_ = isovalue;
  pipeline_->begin_frame();
}

Renderer::Uploads Renderer::uploads() const {
  Uploads sum;
  for (const Level &level : state_.levels) {
    if (const StreamWindow *window = level.stream.window.get()) {
      sum.blocks += window->uploaded_blocks();
      sum.bytes += window->uploaded_bytes();
    }
  }
  return sum;
}

PassStats Renderer::stats_of(const PassCounts &counts) {
  const double rays = static_cast<double>(options_.size.num_rays());
  PassStats stats;
  stats.counts = counts;
  stats.counts.window_count = std::min(counts.window_count, counts.active_count);
  const bool is_blocks = options_.pipeline == PipelineKind::kBlocks;
  // Pipeline `rays` looks ahead at the end of a pass, for the rays that are left.
  const uint rays_looking =
      std::min(counts.window_count, is_blocks ? counts.active_count : counts.next_active_count);
  if (rays_looking != 0) stats.n_spec = static_cast<double>(counts.ahead_count) / rays_looking;
  if (is_blocks) stats.visible_blocks = counts.visible_count;
  // A launch that is not needed costs more than a pass that finds slots missing now and then. The
  // counts are a pass old: its requests have taken slots since, and the pass after it may have
  // asked for as many.
  const std::uint64_t spoken_for = 2 * std::uint64_t{counts.requested_count};
  const std::uint32_t num_slots = state_.cache.num_slots;
  state_.slots_are_scarce = num_slots < kSmallCache ||
                            counts.free_count < std::max<std::uint64_t>(num_slots / 4, spoken_for);
  stats.completed_percent = 100.0 * (rays - counts.next_active_count) / rays;
  stats.utilization_percent = 100.0 * counts.granted_count / rays;
  stats.stage_ms = device_.timer().collect();
  return stats;
}

void Renderer::set_voxel_error(double voxel_error) {
  with_fewer_planes({}, voxel_error);  // or throws
  voxel_error_ = voxel_error;
  update_layouts();
}

void Renderer::draw_bound(FieldBound bound) {
  if (bound != FieldBound::kNone) {
    if (!options_.with_bounds) throw std::logic_error("the renderer was made without bounds");
    for (const Level &level : state_.levels)
      value_offset(level.error, bound, 0, value_range_);  // or throws
  }
  bound_ = bound;
  if (options_.with_bounds) state_.levels[0].macrocells.use(static_cast<std::size_t>(bound));
  update_layouts();
}

/// Has blocks decoded as voxel_error_ and bound_ say.
void Renderer::update_layouts() {
  bool changes = false;
  for (std::size_t i = 0; i < state_.levels.size(); ++i) {
    Level &level = state_.levels[i];
    const double voxel_error = voxel_error_of(voxel_error_, i);
    const BlockPrecision planes = with_fewer_planes(level.precision, voxel_error);
    const double few_planes = plane_error(level.precision, voxel_error);
    StreamLayout layout = level.stream.layout;
    layout.min_exponent = planes.min_exponent;
    layout.whole_numbers = planes.whole_numbers ? 1 : 0;
    const ValueOffset offset = value_offset(level.error, bound_, few_planes, value_range_);
    layout.value_offset = offset.uniform;
    layout.bound_unit = offset.unit;
    if (std::memcmp(&layout, &level.stream.layout, sizeof(layout)) == 0) continue;
    changes = true;
    level.stream.layout = layout;
    level.range_error = few_planes;
  }
  if (changes) clear_cache();
}

void Renderer::set_voxel_pixels(double voxel_pixels) {
  check_voxel_pixels(voxel_pixels);
  if (voxel_pixels > 0 && state_.levels.size() == 1) {
    throw Error("a renderer of the finest level alone cannot draw with {} pixels between voxels",
                voxel_pixels);
  }
  options_.voxel_pixels = voxel_pixels;
}

void Renderer::set_size(ImageSize size) {
  check_image_size(size);
  if (size.num_rays() > state_.rays.num_rays) {
    throw Error("{}x{} pixels have more than the {} rays that the renderer was made for",
                size.width, size.height, state_.rays.num_rays);
  }
  options_.size = size;
}

void Renderer::fill_from_kept() {
  kept_.value().show(state_.rays, false);
  device_.finish();
}

void Renderer::enlarge_kept(const Camera &camera, float isovalue) {
  state_.rays.frame = make_frame_params(state_.levels[0].info, camera, options_.size, isovalue);
  kept_.value().show(state_.rays, true);
  device_.finish();
}

void Renderer::clear_cache() {
  state_.cache.clear();
  device_.finish();
  cached_isovalue_.reset();
}

Image8 Renderer::shade(const Appearance &appearance) {
  return shade_(make_shade_params(state_.levels[0].info, appearance), state_.rays,
                options_.size.samples);
}

}  // namespace isowave::core
