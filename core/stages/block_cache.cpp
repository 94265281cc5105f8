#include "core/stages/block_cache.hpp"

#include <algorithm>

#include "core/base/error.hpp"
#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

static_assert(std::uint64_t{ISO_MAX_CACHE_SLOTS} * ISO_BLOCK_VOXELS <= std::uint64_t{1} << 32,
              "kernels find the values of a slot with 32 bits");

std::uint32_t checked_slots(std::uint32_t num_slots) {
  if (num_slots < kMinCacheSlots || num_slots > ISO_MAX_CACHE_SLOTS) {
    throw Error("a block cache of {} slots cannot be used: {} (one dual grid) to {} can", num_slots,
                kMinCacheSlots, ISO_MAX_CACHE_SLOTS);
  }
  return num_slots;
}

}  // namespace

/// Twice as many entries as slots, an eighth of them with evicted blocks' keys at most before the
/// table is rebuilt (H100, 512^3, 65,536 slots: frames take 1.26 ms; with a quarter, 1.45); not a
/// multiple of 3, so that ISO_TABLE_STEP reaches every entry.
std::uint32_t BlockCache::table_groups_for(std::uint32_t num_slots) {
  const std::uint32_t groups = num_slots / 4 + 1;
  return groups % 3 == 0 ? groups + 1 : groups;
}

/// No more than can be granted; a ray's block asks for at most 8, and a block is listed once.
std::uint32_t BlockCache::capacity_for(std::uint32_t num_slots, std::uint64_t num_blocks,
                                       std::uint64_t num_rays) {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>({num_slots, num_blocks, 8 * ISO_MAX_SPECULATION * num_rays}));
}

BlockCache::BlockCache(ocl::Device &device, const FrameParams &grid, std::uint32_t slots,
                       std::uint64_t num_rays, std::uint32_t group_size, bool levels)
    : num_slots(checked_slots(slots)),
      table_groups(table_groups_for(slots)),
      capacity(capacity_for(slots, block_count(grid), num_rays)),
      table(device, "block table", 8 * std::size_t{table_groups}),
      values(device, "block cache", std::size_t{slots} * ISO_BLOCK_VOXELS),
      inside(device, "voxels inside", slots),
      slot_block_ids(device, "cache slot blocks", slots),
      slot_stamps(device, "cache slot stamps", slots),
      requested_bits(device, "requested blocks", 2 * num_macrocells(grid)),
      request_block_ids(device, "block requests", capacity),
      decode_slots(device, "decode slots", capacity),
      state(device, "cache state", 1),
      group_size_(group_size),
      pairs_range_(ocl::Range::strided(num_rays, group_size, device)),
      slots_range_(ocl::Range::strided(slots, group_size, device)),
      requests_range_(ocl::Range::strided(capacity, group_size, device)),
      free_slots_(device, "free slots", slots),
      slot_ranks_(device, "slot ranks", slots),
      slot_changing_(device, "cells of cached blocks", slots),
      rank_histogram_(device, "eviction ranks", ISO_EVICTION_RANKS),
      request_(device, "block_cache", "cache_request",
               with_levels(group_defines(group_size), levels)),
      rank_(device, "block_cache", "cache_rank", with_levels(group_defines(group_size), levels)),
      select_(device, "block_cache", "cache_select",
              with_levels(group_defines(group_size), levels)),
      evict_(device, "block_cache", "cache_evict", with_levels(group_defines(group_size), levels)),
      rebuild_(device, "block_cache", "cache_rebuild",
               with_levels(group_defines(group_size), levels)),
      classify_(device, "block_cache", "cache_classify",
                with_levels(group_defines(group_size), levels)),
      assign_(device, "block_cache", "cache_assign",
              with_levels(group_defines(group_size), levels)),
      clear_(device, "block_cache", "cache_clear", with_levels(group_defines(group_size), levels)) {
  clear();
}

void BlockCache::clear() {
  clear_(slots_range_, num_slots, 8 * table_groups, table, slot_block_ids, slot_stamps, free_slots_,
         state);
}

void BlockCache::classify(Wavefront &rays) {
  classify_(slots_range_, rays.frame, num_slots, slot_block_ids, values, inside, table);
}

void BlockCache::request(Wavefront &rays) {
  request_(pairs_range_, rays.frame, rays.counts, rays.pair_block_ids, table, slot_stamps,
           requested_bits, request_block_ids, capacity, state);
}

void BlockCache::evict(const CountsBuffer &asked, Wavefront &rays) {
  rank_(slots_range_, rays.frame, asked, num_slots, capacity, state, table, slot_block_ids,
        slot_stamps, slot_ranks_, slot_changing_, rank_histogram_);
  select_({1, group_size_}, rays.frame, asked, num_slots, table, slot_stamps, requested_bits,
          request_block_ids, capacity, rank_histogram_, state);
  evict_(slots_range_, rays.frame, asked, num_slots, slot_block_ids, slot_stamps, slot_ranks_,
         table, state, free_slots_);
  rebuild_(slots_range_, rays.frame, asked, num_slots, slot_block_ids, slot_changing_, state,
           table);
}

void BlockCache::assign(const CountsBuffer &asked, Wavefront &rays) {
  assign_(requests_range_, rays.frame, asked, rays.counts, request_block_ids, capacity, free_slots_,
          table, slot_block_ids, slot_stamps, requested_bits, decode_slots, state);
}

}  // namespace isowave::core
