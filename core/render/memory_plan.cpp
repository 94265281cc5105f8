#include "core/render/memory_plan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "core/base/error.hpp"
#include "core/render/pass_readback.hpp"
#include "core/stages/ambient.hpp"
#include "core/stages/bounce.hpp"
#include "core/stages/field_values.hpp"
#include "core/stages/kept_picture.hpp"
#include "core/stages/shade.hpp"
#include "core/stages/zfp_decode.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/level_bounds.hpp"

namespace isowave::core {

namespace {

/// Bytes of compressed blocks that one half of a window holds: enough for a transfer at full speed,
/// little enough that the first is soon under way.
constexpr std::uint64_t kWindowBytes = 2u << 20;
/// A cache of fewer slots is too small to be paid for by keeping the compressed volume on the
/// device: one for so many rays. A judgement, not a measurement: a cold 720p frame touches a block
/// for every two rays, and most again in the next frame.
constexpr std::uint64_t kRaysPerUsefulSlot = 8;

/// Slots per n^2 for a volume of n^3 blocks, whose surface is in about n^2 of them. A cold frame of
/// turbulence decodes 6 n^2 blocks in pipeline `rays`, at 256^3 voxels and at 1024^3, and 9.6 n^2
/// in pipeline `blocks`, which requests whole dual grids (bench/h100.md).
constexpr double kSlotsPerFace = 12;
/// A small picture needs a smaller cache: at most 5 slots per 8 rays.
constexpr std::uint64_t kRaysPerSlot = 8, kSlotsOfThose = 5;
/// A cache begins with as little as half if that keeps the plan below the decoded volume.
constexpr std::uint64_t kLeastPart = 2;
/// Least initial size of a cache, 2^14 slots (5.3 MB), or all blocks if there are fewer: a frame of
/// a small noisy volume needs most of its blocks.
constexpr std::uint64_t kFewSlots = 1 << 14;
/// A frame that lacks a smaller part of its slots finds enough of them.
constexpr std::uint32_t kSparePart = 32;
/// A cache grows to so many times as many slots at most.
constexpr std::uint64_t kMostGrowth = 4;

std::uint32_t window_blocks_for(const CompressedVolume &volume, const MemoryRequest &request,
                                std::uint32_t cache_slots) {
  if (request.window_blocks != 0) return request.window_blocks;
  const std::uint64_t block_bytes = sizeof(uint) * StreamWindow::words_per_block(volume);
  const std::uint64_t wanted =
      std::min<std::uint64_t>({kWindowBytes / block_bytes, volume.block_count(), cache_slots / 4});
  return static_cast<std::uint32_t>(std::max<std::uint64_t>(wanted, kMinCacheSlots));
}

/// Buffers of the stream of one level of detail, or of the volume itself.
ocl::BufferSizes stream_sizes(const MemoryPlan &plan, const CompressedVolume &volume,
                              const MemoryRequest &request) {
  if (plan.stream == StreamPlace::kHost)
    return DeviceStream::sizes(volume, OnHost{plan.window_blocks}, request.bytes());
  const std::uint64_t largest = request.largest_stream_part != 0
                                    ? request.largest_stream_part
                                    : std::numeric_limits<std::uint64_t>::max();
  const StreamSplit split = split_stream(volume, largest);
  if (split.num_parts == 0) {
    throw Error(
        "the compressed volume of {} bytes does not fit {} buffers of {}: leave it on the host",
        volume.word_count() * sizeof(uint), kMaxStreamParts, largest);
  }
  return DeviceStream::sizes(volume, split, request.bytes());
}

/// Adds the buffers of the volume, or of one of its levels of detail.
void add_level(MemoryPlan &plan, const CompressedVolume &volume, const MemoryRequest &request) {
  const ocl::BufferSizes stream = stream_sizes(plan, volume, request);
  plan.stream_bytes += stream.bytes();
  const glm::uvec3 blocks = volume.num_blocks();
  plan.buffers.add(stream).add(Macrocells::sizes(
      num_macrocells(make_grid(volume.info)), plan.limits.macrocells.num_selections,
      request.with_labels ? std::uint64_t{blocks.x} * blocks.y : 0));
  plan.setup_bytes =
      std::max(plan.setup_bytes, plan.total() + Macrocells::setup_scratch_bytes(blocks));
}

RendererLimits limits_of(const CompressedVolume &volume, const MemoryRequest &request,
                         std::uint32_t cache_slots) {
  const std::uint64_t rays = request.num_rays;
  const std::vector<FrameParams> grids = make_level_grids(level_infos(volume, request.with_levels));
  const FrameParams &last = grids.back();  // the others' ranges and masks lie before its
  RendererLimits limits{
      .macrocells = {.num_blocks = last.place.ranges_begin + block_count(last.grid),
                     .num_macrocells = last.place.masks_begin / 2 + num_macrocells(last.grid),
                     .num_selections = std::max<std::size_t>(
                         request.with_bounds ? kNumFieldBounds : 1, request.max_surfaces),
                     .no_data_words = joined_no_data_words(levels_of(volume, request.with_levels))},
      .rays = {.num_rays = rays,
               .with_pairs = false,
               .num_levels = grids.size(),
               .with_given = request.with_given_rays,
               .bounced_sums = !request.with_bounce        ? 0
                               : request.max_surfaces != 0 ? ISO_LAYER_SUMS
                                                           : 1,
               .with_field = request.with_field || request.max_surfaces != 0},
      .cache = BlockCache::limits_for(
          make_id_grid(grids), cache_slots, rays,
          request.with_labels
              ? SlotType::kGroups
              : slot_type_for(levels_of(volume, request.with_levels), request.with_bounds)),
      .wave = {.num_rays = rays, .num_slots = cache_slots, .group_size = request.group_size},
      .kept_rays = request.kept_rays,
      .layers = {.num_rays = rays, .max_surfaces = request.max_surfaces}};
  request.pipeline->add_to(limits.rays);
  return limits;
}

const ocl::BufferSize &largest_of(const ocl::BufferSizes &buffers) {
  return *std::ranges::max_element(buffers, {}, &ocl::BufferSize::bytes);
}

bool fits_parts(const CompressedVolume &volume, const MemoryRequest &request) {
  return request.largest_stream_part == 0 ||
         split_stream(volume, request.largest_stream_part).num_parts != 0;
}

MemoryRequest with_stream(MemoryRequest request, StreamPlace place) {
  request.stream = place;
  return request;
}

}  // namespace

std::string_view to_string(StreamPlace place) {
  return place == StreamPlace::kAuto ? "auto" : place == StreamPlace::kDevice ? "device" : "host";
}

StreamPlace stream_place_from_string(std::string_view name) {
  for (const StreamPlace place : {StreamPlace::kAuto, StreamPlace::kDevice, StreamPlace::kHost}) {
    if (name == to_string(place)) return place;
  }
  throw Error("the compressed volume cannot be on '{}': auto, device, host", name);
}

std::uint32_t first_cache_slots(std::uint64_t num_blocks, std::uint64_t num_rays,
                                bool with_further_rays) {
  const double edge = std::cbrt(double(num_blocks));
  const std::uint64_t wanted =
      std::min(static_cast<std::uint64_t>(std::llround(kSlotsPerFace * edge * edge)),
               num_rays * kSlotsOfThose / kRaysPerSlot) *
      (with_further_rays ? 2 : 1);
  const std::uint64_t slots = std::min(std::max(wanted, kFewSlots), num_blocks);
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(slots, kMinCacheSlots, ISO_MAX_CACHE_SLOTS));
}

std::uint32_t grown_cache_slots(const MemoryPlan &plan, std::uint64_t lacking) {
  const std::uint64_t slots = plan.cache_slots;
  if (!plan.can_grow() || lacking <= slots / kSparePart) return plan.cache_slots;
  // Blocks may have been freed and requested again and again, and count as often.
  const std::uint64_t wanted = std::min((slots + lacking) / 4 * 5, kMostGrowth * slots);
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(wanted, plan.most_slots));
}

MemoryPlan resized(MemoryPlan plan, std::uint32_t cache_slots) {
  plan.cache_slots = plan.limits.cache.num_slots = plan.limits.wave.num_slots = cache_slots;
  plan.buffers.resize(BlockCache::sizes(plan.limits.cache));
  plan.buffers.resize(plan.pipeline->sizes(plan.limits.wave));
  plan.buffers.resize(ZfpDecode::sizes(plan.limits.cache.max_requests(), true, true));
  return plan;
}

FieldPlan plan_shared_field() {
  FieldPlan plan{.shares_blocks = true};
  plan.bytes = FieldValues::sizes(plan.num_labels).bytes();
  return plan;
}

FieldPlan plan_field(const CompressedVolume &field, const MemoryRequest &request,
                     std::uint64_t budget, std::uint32_t cache_slots) {
  const BlockGrid grid = make_grid(field.info);
  const auto plan_of = [&](std::uint32_t slots, StreamPlace place) {
    FieldPlan plan{.num_labels = ISO_NUM_LABELS};
    plan.cache = BlockCache::limits_for(grid, slots, request.num_rays, slot_type_for(field));
    plan.stream = place;
    plan.largest_stream_part = request.largest_stream_part;
    MemoryPlan stream;
    stream.stream = place;
    if (place == StreamPlace::kHost)
      plan.window_blocks = stream.window_blocks = window_blocks_for(field, request, slots);
    const MacrocellBuffers::Limits macrocells{.num_blocks = block_count(grid),
                                              .num_macrocells = num_macrocells(grid)};
    MemoryRequest of_field = request;
    of_field.with_bounds = of_field.with_labels = false;
    plan.bytes = stream_sizes(stream, field, of_field).bytes() +
                 MacrocellBuffers::sizes(macrocells).bytes() +
                 Macrocells::sizes(macrocells.num_macrocells, 1).bytes() +
                 Macrocells::setup_scratch_bytes(field.num_blocks()) +
                 BlockCache::sizes(plan.cache).bytes() +
                 FieldValues::sizes(plan.num_labels).bytes();
    return plan;
  };
  const bool may_be_on_device =
      request.stream == StreamPlace::kDevice ||
      (request.stream == StreamPlace::kAuto && fits_parts(field, request));
  StreamPlace place = may_be_on_device ? StreamPlace::kDevice : StreamPlace::kHost;
  if (request.stream == StreamPlace::kAuto && may_be_on_device &&
      plan_of(kMinCacheSlots, place).bytes > budget / 4)
    place = StreamPlace::kHost;
  std::uint32_t slots =
      cache_slots != 0 ? cache_slots : first_cache_slots(field.block_count(), request.num_rays);
  FieldPlan plan = plan_of(slots, place);
  while (cache_slots == 0 && plan.bytes > budget / 2 && slots > kMinCacheSlots) {
    slots = std::max(slots / 2, kMinCacheSlots);
    plan = plan_of(slots, place);
  }
  return plan;
}

MemoryPlan plan_memory(const CompressedVolume &volume, const MemoryRequest &request,
                       std::uint32_t cache_slots) {
  MemoryPlan plan;
  plan.pipeline = request.pipeline;
  plan.limits = limits_of(volume, request, cache_slots);
  plan.cache_slots = plan.most_slots = cache_slots;
  plan.stream = request.stream == StreamPlace::kHost ? StreamPlace::kHost : StreamPlace::kDevice;
  if (plan.stream == StreamPlace::kHost)
    plan.window_blocks = window_blocks_for(volume, request, cache_slots);
  const RendererLimits &limits = plan.limits;
  plan.buffers = MacrocellBuffers::sizes(limits.macrocells);
  const std::vector<const CompressedVolume *> levels = levels_of(volume, request.with_levels);
  for (const CompressedVolume *level : levels) add_level(plan, *level, request);
  for (std::size_t i = 0; i < levels.size(); ++i)
    plan.buffers.add(ZfpDecode::sizes(limits.cache.max_requests(),
                                      plan.stream == StreamPlace::kHost, levels.size() > 1));
  plan.buffers.add(Wavefront::sizes(limits.rays))
      .add(BlockCache::sizes(limits.cache))
      .add(plan.pipeline->sizes(limits.wave))
      .add(Shade::sizes(request.num_rays))
      .add(PassReadback::sizes());
  if (request.with_given_rays) plan.buffers.add(Ambient::sizes());
  if (request.with_bounce)
    plan.buffers.add(Bounce::sizes(request.max_surfaces != 0 ? request.num_rays : 0));
  if (limits.layers.max_surfaces != 0)
    plan.buffers.add(Layers::sizes(limits.layers)).add(FieldValues::sizes(0, levels.size()));
  if (limits.kept_rays != 0) plan.buffers.add(KeptPicture::sizes(limits.kept_rays));
  return plan;
}

MemoryPlan plan_with_slots(const CompressedVolume &volume, const MemoryRequest &request,
                           std::uint64_t budget, std::uint32_t cache_slots) {
  if (request.stream != StreamPlace::kAuto) {
    MemoryPlan plan = plan_memory(volume, request, cache_slots);
    plan.reason = "as asked for";
    return plan;
  }
  MemoryPlan on_host = plan_memory(volume, with_stream(request, StreamPlace::kHost), cache_slots);
  on_host.reason = "it does not fit beside the cache slots asked for";
  if (!fits_parts(volume, request)) return on_host;
  MemoryPlan on_device =
      plan_memory(volume, with_stream(request, StreamPlace::kDevice), cache_slots);
  on_device.reason = "it fits beside the cache slots asked for, or a window on it is no smaller";
  return on_device.peak() <= budget || on_device.peak() <= on_host.peak() ? on_device : on_host;
}

MemoryPlan plan_within(const ocl::Device &device, const CompressedVolume &volume,
                       const MemoryRequest &request, std::uint64_t budget,
                       std::uint32_t max_slots) {
  const std::uint64_t largest = device.capabilities().largest_allocation;
  const auto fits = [&](std::uint32_t slots, StreamPlace place) {
    const MemoryPlan plan = plan_memory(volume, with_stream(request, place), slots);
    return plan.peak() <= budget && largest_of(plan.buffers).bytes() <= largest;
  };
  const auto most_slots = [&](StreamPlace place) -> std::optional<MemoryPlan> {
    if (!fits(kMinCacheSlots, place)) return {};
    std::uint32_t fitting = kMinCacheSlots, too_many = max_slots + 1;
    while (too_many - fitting > 1) {
      const std::uint32_t middle = fitting + (too_many - fitting) / 2;
      (fits(middle, place) ? fitting : too_many) = middle;
    }
    return plan_memory(volume, with_stream(request, place), fitting);
  };
  const bool may_be_on_device =
      request.stream == StreamPlace::kDevice ||
      (request.stream == StreamPlace::kAuto && fits_parts(volume, request));
  const bool may_be_on_host = request.stream != StreamPlace::kDevice;
  const std::uint64_t useful =
      std::min<std::uint64_t>(max_slots, request.num_rays / kRaysPerUsefulSlot);
  std::optional<MemoryPlan> plan;
  if (may_be_on_device) plan = most_slots(StreamPlace::kDevice);
  if (may_be_on_host && (!plan || plan->cache_slots < useful)) {
    std::optional<MemoryPlan> on_host = most_slots(StreamPlace::kHost);
    if (on_host && (!plan || on_host->cache_slots > plan->cache_slots)) {
      on_host->reason =
          plan ? fmt::format("beside it there would be {} cache slots, and {} are useful",
                             plan->cache_slots, useful)
               : "it does not fit";
      plan = std::move(on_host);
    }
  }
  if (plan) {
    if (request.stream != StreamPlace::kAuto) plan->reason = "as asked for";
    if (plan->reason.empty())
      plan->reason = "it fits beside a useful cache, or a window on it is no smaller";
    return *plan;
  }
  std::optional<MemoryPlan> least;
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
    if (!(place == StreamPlace::kHost ? may_be_on_host : may_be_on_device)) continue;
    MemoryPlan smallest = plan_memory(volume, with_stream(request, place), kMinCacheSlots);
    if (!least || smallest.peak() < least->peak()) least = std::move(smallest);
  }
  if (const ocl::BufferSize &buffer = largest_of(least->buffers); buffer.bytes() > largest) {
    throw Error(
        "buffer '{}' takes {} bytes, and device '{}' gives at most {} to one buffer: draw a "
        "smaller picture or volume, or choose another device",
        buffer.name, buffer.bytes(), device.info().name, largest);
  }
  throw Error(
      "a memory budget of {} bytes is too small: {} would do, {} of them for the compressed volume",
      budget, least->peak(), least->stream_bytes);
}

MemoryPlan plan_to_grow(const ocl::Device &device, const CompressedVolume &volume,
                        const MemoryRequest &request, std::uint64_t budget, std::uint32_t max_slots,
                        std::uint32_t first_slots) {
  MemoryPlan most = plan_within(device, volume, request, budget, max_slots);
  const auto plan_of = [&](std::uint64_t slots) {
    return plan_memory(
        volume, with_stream(request, most.stream),
        static_cast<std::uint32_t>(std::min<std::uint64_t>(slots, most.cache_slots)));
  };
  std::uint64_t num_blocks = 0;
  for (const CompressedVolume *level : levels_of(volume, request.with_levels))
    num_blocks += level->block_count();
  const std::uint64_t first =
      first_slots != 0 ? first_slots
                       : first_cache_slots(num_blocks, request.num_rays,
                                           request.with_given_rays || request.max_surfaces != 0);
  MemoryPlan plan = plan_of(first);
  const std::uint64_t decoded = slot_bytes(plan.limits.cache.slot_type) * volume.block_count();
  if (first_slots == 0 && plan.total() > decoded) {  // bytes grow linearly with the slots
    const std::uint64_t slots = plan.cache_slots, least = std::max(slots / kLeastPart, kFewSlots);
    const MemoryPlan smaller = plan_of(least);
    if (least < slots && smaller.total() < decoded)
      plan = plan_of(least + (slots - least) * (decoded - smaller.total()) /
                                 (plan.total() - smaller.total()));
  }
  plan.most_slots = most.cache_slots;
  plan.reason = std::move(most.reason);
  return plan;
}

}  // namespace isowave::core
