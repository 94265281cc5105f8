#include "core/render/memory_plan.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>

#include "core/base/error.hpp"
#include "core/render/pass_readback.hpp"
#include "core/stages/shade.hpp"
#include "core/view/detail.hpp"
#include "kernels_cl/portable/block_bound.h"

namespace isowave::core {

namespace {

std::uint64_t ceil_div(std::uint64_t count, std::uint64_t size) {
  return (count + size - 1) / size;
}

/// Bytes of compressed blocks that one half of a window holds: enough for a transfer at full speed,
/// little enough that the first is soon under way.
constexpr std::uint64_t kWindowBytes = 2u << 20;
/// A cache of fewer slots is too small to be paid for by keeping the compressed volume on the
/// device: one for so many rays. A judgement, not a measurement: a cold 720p frame touches a block
/// for every two rays, and most again in the next frame.
constexpr std::uint64_t kRaysPerUsefulSlot = 8;

std::uint32_t window_blocks_for(const CompressedVolume &volume, const MemoryRequest &request,
                                std::uint32_t cache_slots) {
  if (request.window_blocks != 0) return request.window_blocks;
  const std::uint64_t block_bytes = sizeof(uint) * StreamWindow::words_per_block(volume);
  const std::uint64_t wanted =
      std::min<std::uint64_t>({kWindowBytes / block_bytes, volume.block_count(), cache_slots / 4});
  return static_cast<std::uint32_t>(std::max<std::uint64_t>(wanted, kMinCacheSlots));
}

/// Of the volume and those of its levels of detail that are on the device.
std::vector<FrameParams> grids_of(const CompressedVolume &volume, const MemoryRequest &request) {
  return make_level_grids(level_infos(volume, request.with_levels));
}

void add_index(MemoryPlan &plan, std::uint64_t words) {
  if (words == 0) return;
  plan.buffers.push_back({"block index", sizeof(uint) * words});
  plan.stream_bytes += plan.buffers.back().bytes;
}

void add_stream(MemoryPlan &plan, const CompressedVolume &volume, const MemoryRequest &request) {
  const std::uint64_t bounds = request.with_bounds ? bound_words(volume) : 0;
  if (plan.stream == StreamPlace::kHost) {
    const std::uint64_t bytes = sizeof(uint) * StreamWindow::half_words(volume, plan.window_blocks);
    for (const char *name :
         {"stream window", "stream window", "stream staging", "stream staging"}) {
      plan.buffers.push_back({name, bytes});
    }
    plan.stream_bytes += 4 * bytes;
    add_index(plan, bounds);
    return;
  }
  const std::uint64_t largest = request.largest_stream_part != 0
                                    ? request.largest_stream_part
                                    : std::numeric_limits<std::uint64_t>::max();
  const StreamSplit split = split_stream(volume, largest);
  if (split.num_parts == 0) {
    throw Error(
        "the compressed volume of {} bytes does not fit {} buffers of {}: leave it on the host",
        volume.word_count() * sizeof(uint), kMaxStreamParts, largest);
  }
  for (const std::uint64_t words : split.words) {
    plan.buffers.push_back({"zfp stream", words * sizeof(uint)});
    plan.stream_bytes += words * sizeof(uint);
  }
  add_index(plan, (volume.is_indexed() ? block_index_words(volume.block_count()) : 0) + bounds);
}

/// Of macrocells: see MacrocellBuffers.
std::size_t num_selections(const MemoryRequest &request) {
  return request.with_bounds ? kNumFieldBounds : 1;
}

/// What the volume, or one of its levels of detail, needs for itself.
void add_level(MemoryPlan &plan, const CompressedVolume &volume, const MemoryRequest &request) {
  add_stream(plan, volume, request);
  plan.buffers.insert(plan.buffers.end(),
                      {{"macrocell ranges", 2 * num_macrocells(make_grid_params(volume.info))},
                       {"active limits", 4 * std::uint64_t{ISO_BOUND_CODES}}});
  for (std::size_t i = 0; i < num_selections(request); ++i)
    plan.buffers.push_back({"active box", 6 * sizeof(int)});
  plan.setup_bytes = std::max(plan.setup_bytes,
                              plan.total() + Macrocells::setup_scratch_bytes(volume.num_blocks()));
}

bool fits_parts(const CompressedVolume &volume, const MemoryRequest &request) {
  return request.largest_stream_part == 0 ||
         split_stream(volume, request.largest_stream_part).num_parts != 0;
}

MemoryRequest with_stream(MemoryRequest request, StreamPlace place) {
  request.stream = place;
  return request;
}

/// Of what pipeline `blocks` needs beside the rays.
void add_pairs(MemoryPlan &plan, const MemoryRequest &request) {
  const std::uint64_t rays = request.num_rays;
  const std::uint64_t visible = std::min<std::uint64_t>(rays, plan.cache_slots);
  const std::uint64_t scan_tile = std::uint64_t{request.group_size} * ISO_SCAN_ITEMS;
  plan.buffers.insert(plan.buffers.end(), {{"mask", 4 * rays},
                                           {"pair block ids", 4 * rays},
                                           {"pair hits", sizeof(PairHit) * rays},
                                           {"closest pairs", 4 * rays},
                                           {"scan tile sums", 4 * ceil_div(rays, scan_tile)},
                                           {"grouped pair ids", 4 * rays},
                                           {"cache slots of pairs", 4 * rays},
                                           {"block rays", sizeof(BlockRays) * visible}});
  if (request.grouping == Grouping::kRadix) {
    plan.buffers.insert(plan.buffers.end(),
                        {{"sort keys, other half", 4 * rays},
                         {"sort values, other half", 4 * rays},
                         {"sort digit table", 4 * RadixSort::table_size(rays, request.group_size)},
                         {"group tile sums", 4 * ceil_div(rays, scan_tile)}});
  } else {
    plan.buffers.insert(plan.buffers.end(),
                        {{"pairs by slot", 4 * std::uint64_t{plan.cache_slots}},
                         {"pair offsets by slot", 4 * std::uint64_t{plan.cache_slots}},
                         {"group candidates", 4}});
  }
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

std::uint64_t MemoryPlan::total() const {
  return std::accumulate(
      buffers.begin(), buffers.end(), std::uint64_t{0},
      [](std::uint64_t sum, const Buffer &buffer) { return sum + buffer.bytes; });
}

std::uint64_t MemoryPlan::peak() const {
  return std::max(total(), setup_bytes);
}

MemoryPlan plan_memory(const CompressedVolume &volume, const MemoryRequest &request,
                       std::uint32_t cache_slots) {
  const std::uint64_t rays = request.num_rays, slots = cache_slots;
  const std::vector<FrameParams> grids = grids_of(volume, request);
  const FrameParams ids = make_id_grid(grids);
  const std::uint64_t listed = BlockCache::capacity_for(cache_slots, block_count(ids), rays);
  MemoryPlan plan;
  plan.cache_slots = cache_slots;
  plan.stream = request.stream == StreamPlace::kHost ? StreamPlace::kHost : StreamPlace::kDevice;
  if (plan.stream == StreamPlace::kHost)
    plan.window_blocks = window_blocks_for(volume, request, plan.cache_slots);
  const FrameParams &last = grids.back();  // the others' ranges and masks lie before its
  plan.buffers = {{"block ranges", 2 * (last.ranges_begin + block_count(last))}};
  for (std::size_t i = 0; i < num_selections(request); ++i)
    plan.buffers.push_back({"macrocell masks", 4 * (last.masks_begin + 2 * num_macrocells(last))});
  for (const CompressedVolume *level : levels_of(volume, request.with_levels))
    add_level(plan, *level, request);
  plan.buffers.insert(plan.buffers.end(),
                      {{"pass counts", sizeof(PassCounts)},
                       {"pass counts, previous", sizeof(PassCounts)},
                       {"pass counts, next", sizeof(PassCounts)},
                       {"pass counts, read back", PassReadback::kMaxInFlight * sizeof(PassCounts)},
                       {"level frames", sizeof(FrameParams) * grids.size()},
                       {"hits", sizeof(HitRecord) * rays},
                       {"ray states", 4 * rays},
                       {"active ray ids", 4 * rays},
                       {"active ray ids, next", 4 * rays}});
  if (request.pipeline == PipelineKind::kBlocks) {
    add_pairs(plan, request);
  } else {  // the pairs' arrays are empty: OpenCL has no buffers of 0 bytes
    plan.buffers.insert(
        plan.buffers.end(),
        {{"mask", 1}, {"pair block ids", 1}, {"pair hits", 1}, {"closest pairs", 1}});
  }
  plan.buffers.insert(
      plan.buffers.end(),
      {{"block table", 8 * sizeof(BlockEntry) * BlockCache::table_groups_for(cache_slots)},
       {"block cache", ISO_BLOCK_VOXELS * sizeof(float) * slots},
       {"voxels inside", 8 * slots},
       {"cache slot blocks", 4 * slots},
       {"cache slot stamps", 4 * slots},
       {"free slots", 4 * slots},
       {"requested blocks", 8 * num_macrocells(ids)},
       {"block requests", 4 * listed},
       {"decode slots", 4 * listed},
       {"slot ranks", slots},
       {"cells of cached blocks", 8 * slots},
       {"eviction ranks", 4 * std::uint64_t{ISO_EVICTION_RANKS}},
       {"cache state", sizeof(CacheState)},
       {"shading", sizeof(ShadeParams)},
       {"framebuffer", 4 * rays}});
  if (grids.size() > 1 && plan.stream == StreamPlace::kHost) {
    for (std::size_t i = 0; i < grids.size(); ++i)
      plan.buffers.push_back({"decode places", 4 * listed});
  }
  if (request.kept_rays != 0)
    plan.buffers.push_back({"kept hits", sizeof(HitRecord) * request.kept_rays});
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
    return plan_memory(volume, with_stream(request, place), slots).peak() <= budget &&
           ISO_BLOCK_VOXELS * sizeof(float) * std::uint64_t{slots} <= largest;
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
  throw Error(
      "a memory budget of {} bytes is too small: {} would do, {} of them for the compressed volume",
      budget, least->peak(), least->stream_bytes);
}

}  // namespace isowave::core
