#include "core/memory_plan.hpp"

#include <algorithm>
#include <numeric>

#include "core/error.hpp"
#include "core/shade.hpp"

namespace isowave {

namespace {

std::uint64_t ceil_div(std::uint64_t count, std::uint64_t size) {
  return (count + size - 1) / size;
}

/// Of what pipeline `blocks` needs beside the rays.
void add_pairs(MemoryPlan &plan, const MemoryRequest &request) {
  const std::uint64_t pixels = request.num_pixels;
  const std::uint64_t visible = std::min<std::uint64_t>(pixels, plan.cache_slots);
  const std::uint64_t scan_tile = std::uint64_t{request.group_size} * ISO_SCAN_ITEMS;
  plan.buffers.insert(plan.buffers.end(), {{"mask", 4 * pixels},
                                           {"pair block ids", 4 * pixels},
                                           {"pair hits", sizeof(PairHit) * pixels},
                                           {"closest pairs", 4 * pixels},
                                           {"scan tile sums", 4 * ceil_div(pixels, scan_tile)},
                                           {"grouped pair ids", 4 * pixels},
                                           {"grouped slots", 4 * pixels},
                                           {"block ray offsets", 4 * visible}});
  if (request.grouping == Grouping::kRadix) {
    const std::uint64_t sort_tile = std::uint64_t{request.group_size} * ISO_RADIX_ITEMS;
    plan.buffers.insert(plan.buffers.end(),
                        {{"sort keys, other half", 4 * pixels},
                         {"sort values, other half", 4 * pixels},
                         {"sort digit table", 4 * ISO_RADIX_DIGITS * ceil_div(pixels, sort_tile)}});
  } else {
    plan.buffers.insert(plan.buffers.end(), {{"pairs by slot", 4 * std::uint64_t{plan.cache_slots}},
                                             {"group tile sums", 4 * ceil_div(visible, scan_tile)}});
  }
}

}  // namespace

std::uint64_t MemoryPlan::total() const {
  return std::accumulate(buffers.begin(), buffers.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const Buffer &buffer) { return sum + buffer.bytes; });
}

std::uint64_t MemoryPlan::peak() const {
  return std::max(total(), setup_bytes);
}

MemoryPlan plan_memory(const CompressedVolume &volume, const MemoryRequest &request,
                       std::uint32_t cache_slots) {
  const std::uint64_t pixels = request.num_pixels, blocks = volume.block_count(), slots = cache_slots;
  const glm::uvec3 cells = (volume.num_blocks() + 3u) / 4u;
  const std::uint64_t num_cells = std::uint64_t{cells.x} * cells.y * cells.z;
  const std::uint64_t listed = BlockCache::capacity_for(cache_slots, blocks, pixels);
  MemoryPlan plan;
  plan.cache_slots = cache_slots;
  plan.buffers = {{"zfp stream", volume.words.size() * sizeof(uint)},
                  {"frame", sizeof(FrameParams)},
                  {"pass counts", sizeof(PassCounts)},
                  {"pass counts, previous", sizeof(PassCounts)},
                  {"pass counts, next", sizeof(PassCounts)},
                  {"hits", sizeof(HitRecord) * pixels},
                  {"ray states", 4 * pixels},
                  {"active ray ids", 4 * pixels},
                  {"active ray ids, next", 4 * pixels},
                  {"block ranges", 2 * blocks},
                  {"macrocell ranges", 2 * num_cells},
                  {"macrocell masks", 8 * num_cells},
                  {"active box", 6 * sizeof(int)}};
  if (request.pipeline == PipelineKind::kBlocks) {
    add_pairs(plan, request);
  } else {  // the pairs' arrays are empty: OpenCL has no buffers of 0 bytes
    plan.buffers.insert(plan.buffers.end(),
                        {{"mask", 1}, {"pair block ids", 1}, {"pair hits", 1}, {"closest pairs", 1}});
  }
  plan.setup_bytes = plan.total() + Macrocells::setup_scratch_bytes(volume.num_blocks());
  plan.buffers.insert(plan.buffers.end(),
                      {{"block table", 8 * sizeof(BlockEntry) * BlockCache::table_groups_for(cache_slots)},
                       {"block cache", ISO_BLOCK_VOXELS * sizeof(float) * slots},
                       {"cache slot blocks", 4 * slots},
                       {"cache slot stamps", 4 * slots},
                       {"free slots", 4 * slots},
                       {"requested blocks", 8 * num_cells},
                       {"block requests", 4 * listed},
                       {"decode slots", 4 * listed},
                       {"decode entries", 4 * listed},
                       {"cache ages", 4 * std::uint64_t{ISO_AGE_BUCKETS}},
                       {"cache state", sizeof(CacheState)},
                       {"shading", sizeof(ShadeParams)},
                       {"framebuffer", 4 * pixels}});
  return plan;
}

MemoryPlan plan_within(const ocl::Device &device, const CompressedVolume &volume,
                       const MemoryRequest &request, std::uint64_t budget, std::uint32_t max_slots) {
  const std::uint64_t largest = device.capabilities().largest_allocation;
  const auto fits = [&](std::uint32_t slots) {
    return plan_memory(volume, request, slots).peak() <= budget &&
           ISO_BLOCK_VOXELS * sizeof(float) * std::uint64_t{slots} <= largest;
  };
  if (!fits(kMinCacheSlots)) {
    const MemoryPlan least = plan_memory(volume, request, kMinCacheSlots);
    throw Error("a memory budget of {} bytes is too small: {} would do, {} of them for the compressed volume",
                budget, least.peak(), least.buffers.front().bytes);
  }
  std::uint32_t fitting = kMinCacheSlots, too_many = max_slots + 1;
  while (too_many - fitting > 1) {
    const std::uint32_t middle = fitting + (too_many - fitting) / 2;
    (fits(middle) ? fitting : too_many) = middle;
  }
  return plan_memory(volume, request, fitting);
}

}  // namespace isowave
