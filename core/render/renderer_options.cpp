#include "core/render/renderer_options.hpp"

#include <algorithm>
#include <bit>

#include "core/base/error.hpp"
#include "core/frame/labels.hpp"
#include "core/stages/kept_picture.hpp"
#include "core/view/detail.hpp"

namespace isowave::core {

RendererOptions checked(RendererOptions options, const CompressedVolume &volume,
                        const ocl::Device &device) {
  check_volume_info(volume.info, "the volume");
  check_image_size(options.size);
  if (options.with_levels) check_has_levels(volume);
  if (options.with_levels && !options.pipeline->has_levels())
    throw Error(
        "pipeline {} draws only the finest level of detail: take pipeline rays, or allow 0 pixels",
        options.pipeline->name());
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
  if (!std::has_single_bit(options.group_size) || options.group_size < 8 ||
      options.group_size > 256) {
    throw Error("a work-group size of {} cannot be used: a power of two from 8 to 256 can",
                options.group_size);
  }
  if (options.first_slots != 0 && options.first_slots < kMinCacheSlots) {
    throw Error("a cache cannot begin with {} slots: {} (one dual grid) and more can",
                options.first_slots, kMinCacheSlots);
  }
  if (options.window_blocks != 0 && options.window_blocks < kMinCacheSlots) {
    throw Error("a window of {} blocks cannot be used: {} (one dual grid) and more can",
                options.window_blocks, kMinCacheSlots);
  }
  if (options.max_surfaces > ISO_MAX_SURFACES)
    throw Error("a frame has at most {} surfaces: {} are too many", ISO_MAX_SURFACES,
                options.max_surfaces);
  if (options.max_surfaces != 0 &&
      (!options.pipeline->has_clipping() || options.solver.kind != ISO_SOLVER_BERNSTEIN))
    throw Error(
        "several and translucent surfaces are drawn by pipeline rays and solver bernstein: "
        "leave out with_surfaces");
  if (options.with_labels) {
    check_labels(volume);
    const auto leave_out = [](bool is_given, const char *what) {
      if (is_given) throw Error("labels are drawn without {0}: leave out {0}", what);
    };
    leave_out(options.with_levels, "with_levels");
    leave_out(options.with_bounds, "with_bounds");
    leave_out(options.with_kept_picture, "with_time_budget");
    if (options.max_surfaces == 0)
      throw Error("labels are drawn as surfaces: give with_surfaces, 1 to {}", ISO_MAX_SURFACES);
  }
  if (options.field != nullptr) {
    check_volume_info(options.field->info, "the field");
    if (!options.pipeline->has_clipping())
      throw Error("colours by a field are drawn by pipeline rays: leave out the field");
    if (options.field->block_count() >= ISO_MAX_BLOCK_IDS)
      throw Error("a field of {} blocks cannot be read: block ids end at {}",
                  options.field->block_count(), ISO_MAX_BLOCK_IDS);
  }
  if (options.largest_stream_part == 0) {
    options.largest_stream_part = device.capabilities().largest_allocation;
  }
  options.with_given_rays |= options.with_bounce;
  return options;
}

namespace {

/// The plan of the renderer without its field.
MemoryPlan plan_of_volume(const ocl::Device &device, const CompressedVolume &volume,
                          const RendererOptions &options, const MemoryRequest &request,
                          std::uint64_t budget) {
  std::uint64_t num_blocks = 0;
  for (const CompressedVolume *level : levels_of(volume, request.with_levels))
    num_blocks += level->block_count();
  if (options.cache_slots != 0) {
    MemoryPlan plan = plan_with_slots(volume, request, budget, options.cache_slots);
    if (options.memory_budget != 0 && plan.peak() > budget) {
      throw Error(
          "{} cache slots need {} bytes of device memory, more than the budget of {}: give one of "
          "the two alone",
          options.cache_slots, plan.peak(), budget);
    }
    return plan;
  }
  const bool grows = options.memory_budget == 0;
  const std::uint64_t most = grows ? kAmpleCacheSlots : ISO_MAX_CACHE_SLOTS;
  const auto max_slots =
      static_cast<std::uint32_t>(std::clamp<std::uint64_t>(num_blocks, kMinCacheSlots, most));
  return grows ? plan_to_grow(device, volume, request, budget, max_slots, options.first_slots)
               : plan_within(device, volume, request, budget, max_slots);
}

}  // namespace

bool shares_blocks(const RendererOptions &options, const CompressedVolume &volume) {
  return options.field == &volume && !options.with_labels;
}

MemoryPlan make_plan(const ocl::Device &device, const CompressedVolume &volume,
                     const RendererOptions &options) {
  const MemoryRequest request{options.size.num_rays(),
                              options.pipeline,
                              options.group_size,
                              options.stream,
                              options.largest_stream_part,
                              options.window_blocks,
                              options.with_levels,
                              options.with_bounds,
                              options.with_kept_picture ? halved(options.size, 1).num_rays() : 0,
                              options.with_given_rays,
                              options.max_surfaces,
                              options.field != nullptr,
                              options.with_labels,
                              options.with_bounce};
  std::uint64_t budget = options.memory_budget != 0 ? options.memory_budget
                                                    : device.capabilities().global_memory / 4 * 3;
  if (options.field != nullptr) {
    const FieldPlan field = shares_blocks(options, volume)
                                ? plan_shared_field()
                                : plan_field(*options.field, request, budget, options.field_slots);
    if (field.bytes >= budget)
      throw Error("a memory budget of {} bytes is too small: the field takes {} of them", budget,
                  field.bytes);
    budget -= field.bytes;
    MemoryPlan plan = plan_of_volume(device, volume, options, request, budget);
    plan.field = field;
    return plan;
  }
  return plan_of_volume(device, volume, options, request, budget);
}

}  // namespace isowave::core
