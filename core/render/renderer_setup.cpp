#include "core/render/renderer_setup.hpp"

#include <algorithm>
#include <bit>
#include <memory>

#include "core/base/error.hpp"
#include "core/stages/kept_picture.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/block_grid.h"

namespace isowave {

RendererOptions checked_options(RendererOptions options, const CompressedVolume &volume,
                                const ocl::Device &device) {
  check_volume_info(volume.info, "the volume");
  check_image_size(options.max_size);
  if (options.with_levels) check_levels(volume);
  if (options.with_levels && options.pipeline == PipelineKind::kBlocks)
    throw Error(
        "pipeline blocks draws one level of detail: leave it to pipeline rays, or allow 0 pixels");
  const std::uint64_t layer_ids = std::uint64_t{volume.num_blocks().x} * volume.num_blocks().y;
  std::uint64_t num_ids = 0;  // see make_id_grid()
  for (const CompressedVolume *level : levels_of(volume, options.with_levels))
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

MemoryPlan plan_renderer(const ocl::Device &device, const CompressedVolume &volume,
                         const RendererOptions &options) {
  const MemoryRequest request{
      options.max_size.num_rays(),
      options.pipeline,
      options.grouping,
      options.group_size,
      options.stream,
      options.largest_stream_part,
      options.window_blocks,
      options.with_levels,
      options.with_bounds,
      options.with_kept_picture ? halved(options.max_size, 1).num_rays() : 0};
  const std::uint64_t budget = options.memory_budget != 0
                                   ? options.memory_budget
                                   : device.capabilities().global_memory / 4 * 3;
  std::uint64_t num_blocks = 0;
  for (const CompressedVolume *level : levels_of(volume, options.with_levels))
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

FrameState make_frame_state(ocl::Device &device, const CompressedVolume &volume,
                            const RendererOptions &options, const MemoryPlan &plan) {
  const std::vector<const CompressedVolume *> volumes = levels_of(volume, options.with_levels);
  const std::vector<FrameParams> grids = make_level_grids(level_infos(volume, options.with_levels));
  const FrameParams ids = make_id_grid(grids), &last = grids.back();
  const bool has_levels = volumes.size() > 1;
  const auto buffers = std::make_shared<MacrocellBuffers>(
      device, last.ranges_begin + block_count(last), last.masks_begin / 2 + num_macrocells(last),
      options.with_bounds ? kNumFieldBounds : 1);
  const std::uint64_t num_rays = options.max_size.num_rays();
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

LevelDecoding decoding_of(const Level &level, std::size_t index, double voxel_error,
                          FieldBound bound, const std::array<float, 2> &value_range) {
  const double allowed = voxel_error_of(voxel_error, index);
  const BlockPrecision planes = with_fewer_planes(level.precision, allowed);
  const double few_planes = plane_error(level.precision, allowed);
  const ValueOffset offset = value_offset(level.error, bound, few_planes, value_range);
  return {planes.min_exponent, planes.whole_numbers, few_planes, offset.uniform, offset.unit};
}

void set_decoding(Level &level, const LevelDecoding &decoding) {
  StreamLayout &layout = level.stream.layout;
  layout.min_exponent = decoding.min_exponent;
  layout.whole_numbers = decoding.whole_numbers ? 1 : 0;
  layout.value_offset = decoding.uniform_offset;
  layout.bound_unit = decoding.unit_offset;
  level.range_error = decoding.plane_error;
}

}  // namespace isowave
