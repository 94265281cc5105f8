#include "core/group.hpp"

#include <algorithm>
#include <bit>

#include "core/error.hpp"

namespace isowave {

namespace {

/// Work-items per group of the kernels that take any number.
constexpr std::uint32_t kGroupSize = 64;

/// Distinct blocks that a pass's pairs can belong to.
std::uint64_t max_visible(std::uint64_t num_pixels, std::uint32_t num_slots) {
  return std::min<std::uint64_t>(num_pixels, num_slots);
}

/// Tiles of group_size * ISO_SCAN_ITEMS entries.
std::uint64_t num_tiles(std::uint64_t count, std::uint32_t group_size) {
  const std::uint64_t tile = std::uint64_t{group_size} * ISO_SCAN_ITEMS;
  return (count + tile - 1) / tile;
}

/// A launch over `count` entries in such tiles.
ocl::Range tiles_range(std::uint64_t count, std::uint32_t group_size, const ocl::Device &device) {
  return ocl::Range::strided(num_tiles(count, group_size) * group_size, group_size, device);
}

ocl::Defines group_stage_defines(std::uint32_t group_size, ClosestHit closest) {
  ocl::Defines defines = group_defines(group_size);
  defines.merge(closest_defines(closest));
  return defines;
}

}  // namespace

std::string_view to_string(Grouping grouping) {
  return grouping == Grouping::kRadix ? "radix" : "counting";
}

Grouping grouping_from_string(std::string_view name) {
  for (const Grouping grouping : {Grouping::kRadix, Grouping::kCounting}) {
    if (name == to_string(grouping)) return grouping;
  }
  throw Error("no grouping is called '{}'; there are: radix, counting", name);
}

Group::Group(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t num_slots, std::uint32_t group_size,
             Grouping grouping, ClosestHit closest)
    : groups_{{device, "grouped pair ids", num_pixels},
              {device, "grouped slots", num_pixels},
              {device, "block ray offsets", max_visible(num_pixels, num_slots)}},
      gather_(grouping == Grouping::kRadix ? decltype(gather_)(std::in_place_type<ByRadix>, device,
                                                               num_pixels, num_slots, group_size, closest)
                                           : decltype(gather_)(std::in_place_type<ByCounting>, device,
                                                               num_pixels, num_slots, group_size, closest)) {}

void Group::operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction) {
  if (auto *by_radix = std::get_if<ByRadix>(&gather_)) {
    (*by_radix)(cache, rays, compaction, groups_);
  } else {
    std::get<ByCounting>(gather_)(cache, rays, groups_);
  }
}

Group::ByRadix::ByRadix(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t num_slots,
                        std::uint32_t group_size, ClosestHit closest)
    : range(ocl::Range::strided(num_pixels, kGroupSize, device)),
      key_bits(std::max(1, static_cast<int>(std::bit_width(num_slots - 1)))),
      sort(device, num_pixels, group_size),
      select(device, "group", "group_select", group_stage_defines(group_size, closest)),
      keys(device, "group", "group_keys", group_stage_defines(group_size, closest)),
      heads(device, "group", "group_heads", group_stage_defines(group_size, closest)) {}

void Group::ByRadix::operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction,
                                BlockGroups &groups) {
  select(range, rays.frame, rays.counts, rays.pair_block_ids, cache.table, rays.pair_hits, rays.closest_pairs,
         rays.mask);
  compaction.indices(rays.mask, rays.counts, ISO_COUNT_FIELD(pair_slot_count), groups.pair_ids,
                     ISO_COUNT_FIELD(granted_count));
  keys(range, rays.frame, rays.counts, groups.pair_ids, rays.pair_block_ids, cache.table, groups.slots);
  sort(groups.slots, groups.pair_ids, rays.counts, ISO_COUNT_FIELD(granted_count), key_bits);
  heads(range, rays.counts, groups.slots, rays.mask);
  compaction.indices(rays.mask, rays.counts, ISO_COUNT_FIELD(granted_count), groups.block_ray_offsets,
                     ISO_COUNT_FIELD(visible_count));
}

Group::ByCounting::ByCounting(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t num_slots,
                              std::uint32_t group_size, ClosestHit closest)
    : pairs_range(ocl::Range::strided(num_pixels, kGroupSize, device)),
      pair_tiles_range(tiles_range(num_pixels, group_size, device)),
      visible_range(ocl::Range::strided(max_visible(num_pixels, num_slots), kGroupSize, device)),
      visible_tiles_range(tiles_range(max_visible(num_pixels, num_slots), group_size, device)),
      slot_counts(device, "pairs by slot", num_slots),
      tile_sums(device, "group tile sums", num_tiles(max_visible(num_pixels, num_slots), group_size)),
      count(device, "group", "group_count", group_stage_defines(group_size, closest)),
      sum_tiles(device, "group", "group_tile_sums", group_stage_defines(group_size, closest)),
      offsets(device, "group", "group_offsets", group_stage_defines(group_size, closest)),
      scatter(device, "group", "group_scatter", group_stage_defines(group_size, closest)),
      clear(device, "group", "group_clear", group_stage_defines(group_size, closest)) {}

void Group::ByCounting::operator()(const BlockCache &cache, Wavefront &rays, BlockGroups &groups) {
  const ocl::Buffer<uint> &pair_ranks = rays.mask, &visible_slots = groups.block_ray_offsets;
  count(pair_tiles_range, rays.frame, rays.counts, rays.pair_block_ids, cache.table, rays.pair_hits,
        rays.closest_pairs, rays.mask, slot_counts, groups.block_ray_offsets);
  sum_tiles(visible_tiles_range, rays.counts, visible_slots, slot_counts, tile_sums);
  offsets(visible_tiles_range, rays.counts, tile_sums, slot_counts, groups.block_ray_offsets);
  scatter(pairs_range, rays.frame, rays.counts, rays.pair_block_ids, cache.table, pair_ranks, slot_counts,
          groups.pair_ids, groups.slots);
  clear(visible_range, rays.counts, groups.slots, groups.block_ray_offsets, slot_counts);
}

}  // namespace isowave
