#include "core/block_cache.hpp"

#include <algorithm>

#include "core/error.hpp"
#include "kernels_cl/block_grid.h"

namespace isowave {

namespace {

std::uint32_t checked_slots(std::uint32_t num_slots) {
  if (num_slots < kMinCacheSlots || num_slots > ISO_MAX_CACHE_SLOTS) {
    throw Error("a block cache of {} slots cannot be used: {} (one dual grid) to {} can", num_slots,
                kMinCacheSlots, ISO_MAX_CACHE_SLOTS);
  }
  return num_slots;
}

/// A pair asks for at most 8 blocks, and a block is listed once.
std::size_t max_requests(std::uint64_t num_blocks, std::uint64_t num_pixels) {
  return static_cast<std::size_t>(std::min(num_blocks, 8 * num_pixels));
}

}  // namespace

BlockCache::BlockCache(ocl::Device &device, std::uint64_t num_blocks, std::uint32_t num_slots,
                       std::uint64_t num_pixels, std::uint32_t group_size)
    : num_slots_(checked_slots(num_slots)),
      group_size_(group_size),
      pairs_range_(ocl::Range::strided(num_pixels, group_size, device)),
      slots_range_(ocl::Range::strided(num_slots, group_size, device)),
      requests_range_(ocl::Range::strided(max_requests(num_blocks, num_pixels), group_size, device)),
      page_table_(device, "page table", num_blocks),
      slot_block_ids_(device, "cache slot blocks", num_slots),
      slot_stamps_(device, "cache slot stamps", num_slots),
      request_block_ids_(device, "block requests", max_requests(num_blocks, num_pixels)),
      victim_slots_(device, "freed slots", num_slots),
      age_histogram_(device, "cache ages", ISO_AGE_BUCKETS),
      selection_(device, "cache selection", 1),
      values_(device, "block cache", std::size_t{num_slots} * ISO_BLOCK_VOXELS),
      request_(device, "block_cache", "cache_request", group_defines(group_size)),
      age_histogram_kernel_(device, "block_cache", "cache_age_histogram", group_defines(group_size)),
      select_(device, "block_cache", "cache_select", group_defines(group_size)),
      collect_victims_(device, "block_cache", "cache_collect_victims", group_defines(group_size)),
      assign_(device, "block_cache", "cache_assign", group_defines(group_size)) {
  clear();
}

void BlockCache::clear() {
  page_table_.fill(ISO_BLOCK_ABSENT);
  slot_block_ids_.fill(ISO_INVALID_ID);
  slot_stamps_.fill(0);  // older than every pass (Wavefront)
}

void BlockCache::request(Wavefront &rays) {
  request_(pairs_range_, rays.frame, rays.counts, rays.pair_block_ids, page_table_, slot_stamps_,
           request_block_ids_);
}

void BlockCache::assign_slots(Wavefront &rays) {
  age_histogram_kernel_(slots_range_, rays.counts, num_slots_, slot_stamps_, age_histogram_);
  select_({1, group_size_}, rays.frame, rays.counts, num_slots_, rays.pair_block_ids, page_table_,
          slot_stamps_, request_block_ids_, age_histogram_, selection_);
  collect_victims_(slots_range_, rays.counts, num_slots_, slot_stamps_, selection_, victim_slots_);
  assign_(requests_range_, rays.counts, request_block_ids_, victim_slots_, page_table_, slot_block_ids_,
          slot_stamps_);
}

}  // namespace isowave
