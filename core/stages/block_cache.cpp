#include "core/stages/block_cache.hpp"

#include <algorithm>

#include "core/base/error.hpp"

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

/// Words of the table. The directory has room for neighbours of the last groups, beyond the volume.
std::uint64_t table_words(const BlockCache::Limits &limits) {
  const std::uint64_t groups_x = (limits.blocks_x + 1) / 2, groups_y = (limits.blocks_y + 1) / 2,
                      layers = limits.num_blocks / limits.blocks_x / limits.blocks_y,
                      groups = groups_x * groups_y * ((layers + 1) / 2 + 1) + groups_x + 1;
  return 9 * std::uint64_t{limits.num_slots} + 8 + groups;
}

}  // namespace

std::uint32_t BlockCache::Limits::max_requests() const {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>({num_slots, num_blocks, 8 * ISO_MAX_SPECULATION * num_rays}));
}

ocl::BufferSizes BlockCache::sizes(const Limits &limits) {
  const std::uint64_t slots = limits.num_slots, requests = limits.max_requests();
  return {ocl::buffer_size<uint>("block table", table_words(limits)),
          ocl::buffer_size<SlotValue>("block cache", slot_bytes(limits.slot_type) * slots),
          ocl::buffer_size<ulong>("voxels inside", slots),
          ocl::buffer_size<uint>("cache slot blocks", slots),
          ocl::buffer_size<uint>("cache slot stamps", slots),
          ocl::buffer_size<uint>("free slots", slots),
          ocl::buffer_size<uint>("requested blocks", 2 * limits.num_macrocells),
          ocl::buffer_size<uint>("block requests", requests),
          ocl::buffer_size<uint>("decode slots", requests),
          ocl::buffer_size<uchar>("slot ranks", slots),
          ocl::buffer_size<ulong>("cells of cached blocks", slots),
          ocl::buffer_size<uint>("eviction ranks", ISO_EVICTION_RANKS),
          ocl::buffer_size<uint>("touched blocks", 1),
          ocl::buffer_size<CacheState>("cache state", 1)};
}

BlockCache::BlockCache(ocl::Device &device, const Limits &limits, std::uint32_t group_size,
                       bool levels)
    : BlockCache(device, limits, sizes(limits), group_size,
                 with_levels(group_defines(group_size), levels)) {}

BlockCache::BlockCache(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
                       std::uint32_t group_size, const ocl::Defines &defines)
    : slot_type(limits.slot_type),
      num_slots(checked_slots(limits.num_slots)),
      capacity(limits.max_requests()),
      table(device, sizes["block table"]),
      values(device, sizes["block cache"]),
      inside(device, sizes["voxels inside"]),
      changing(device, sizes["cells of cached blocks"]),
      slot_block_ids(device, sizes["cache slot blocks"]),
      slot_stamps(device, sizes["cache slot stamps"]),
      free_slots(device, sizes["free slots"]),
      requested_bits(device, sizes["requested blocks"]),
      request_block_ids(device, sizes["block requests"]),
      decode_slots(device, sizes["decode slots"]),
      state(device, sizes["cache state"]),
      group_size_(group_size),
      blocks_x_(limits.blocks_x),
      blocks_y_(limits.blocks_y),
      pairs_range_(ocl::Range::strided(limits.num_rays, group_size, device)),
      slots_range_(ocl::Range::strided(num_slots, group_size, device)),
      requests_range_(ocl::Range::strided(capacity, group_size, device)),
      slot_ranks_(device, sizes["slot ranks"]),
      rank_histogram_(device, sizes["eviction ranks"]),
      touched_(device, sizes["touched blocks"]),
      request_(device, defines),
      rank_(device, defines),
      select_(device, defines),
      evict_(device, defines),
      classify_(device, defines),
      assign_(device, defines),
      count_touched_(device, defines),
      clear_(device, defines) {
  make_empty();
}

void BlockCache::make_empty() {
  clear(static_cast<uint>(table.size() - directory_begin(num_slots)));
}

void BlockCache::clear() {
  clear(0);
}

void BlockCache::clear(uint directory_words) {
  clear_(slots_range_, num_slots, blocks_x_, blocks_y_, directory_words, table, slot_block_ids,
         slot_stamps, free_slots, state);
}

void BlockCache::resize(const Limits &limits) {
  checked_slots(limits.num_slots);
  const ocl::BufferSizes made = sizes(limits);
  const auto of_slots = [&](auto &&visit) {
    visit(table), visit(values), visit(inside), visit(changing), visit(slot_block_ids),
        visit(slot_stamps), visit(free_slots), visit(request_block_ids), visit(decode_slots),
        visit(slot_ranks_);
  };
  ocl::Device &device = state.device();
  device.finish();  // kernels may still use what goes
  of_slots([](auto &buffer) { const auto gone = std::move(buffer); });
  of_slots([&](auto &buffer) { buffer = {device, made[buffer.name()]}; });
  num_slots = limits.num_slots;
  capacity = limits.max_requests();
  slots_range_ = ocl::Range::strided(num_slots, group_size_, device);
  requests_range_ = ocl::Range::strided(capacity, group_size_, device);
  requested_bits.fill(0);
  make_empty();
  device.finish();
}

void BlockCache::classify(Wavefront &rays) {
  classify_(slots_range_, rays.frame, num_slots, static_cast<uint>(slot_type), slot_block_ids,
            values, inside, changing);
}

void BlockCache::count_touched(Wavefront &rays, bool in_dual_grids) {
  touched_.fill(0);
  count_touched_(slots_range_, rays.frame, rays.counts, num_slots, in_dual_grids ? 1u : 0u, table,
                 slot_block_ids, slot_stamps, touched_);
}

void BlockCache::request(Wavefront &rays) {
  request_(pairs_range_, rays.frame, rays.counts, rays.pair_block_ids, rays.pair_begins,
           rays.pair_rays, table, slot_stamps, requested_bits, request_block_ids, capacity, state);
}

void BlockCache::evict(const CountsBuffer &asked, Wavefront &rays) {
  rank_(slots_range_, rays.frame, asked, num_slots, capacity, state, table, slot_block_ids,
        slot_stamps, slot_ranks_, rank_histogram_);
  select_(ocl::Range::groups(1, group_size_), rays.frame, asked, num_slots, table, slot_stamps,
          requested_bits, request_block_ids, capacity, rank_histogram_, state);
  evict_(slots_range_, rays.frame, asked, num_slots, slot_block_ids, slot_stamps, slot_ranks_,
         table, state, free_slots);
}

void BlockCache::assign(const CountsBuffer &asked, Wavefront &rays) {
  assign_(requests_range_, rays.frame, asked, rays.counts, request_block_ids, capacity, free_slots,
          table, changing, slot_block_ids, slot_stamps, requested_bits, decode_slots, state);
}

}  // namespace isowave::core
