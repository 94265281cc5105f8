#include "core/stages/group.hpp"

#include <algorithm>
#include <bit>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

/// Distinct blocks that a pass's pairs can belong to.
std::uint64_t max_visible(std::uint64_t num_rays, std::uint32_t num_slots) {
  return std::min<std::uint64_t>(num_rays, num_slots);
}

/// Tiles of group_size * items entries.
std::uint64_t num_tiles(std::uint64_t count, std::uint32_t group_size, std::uint32_t items) {
  const std::uint64_t tile = std::uint64_t{group_size} * items;
  return (count + tile - 1) / tile;
}

/// A launch over `count` entries in such tiles.
ocl::Range tiles_range(std::uint64_t count, std::uint32_t group_size, std::uint32_t items,
                       const ocl::Device &device) {
  return ocl::Range::strided(num_tiles(count, group_size, items) * group_size, group_size, device);
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

Group::Group(ocl::Device &device, std::uint64_t num_rays, std::uint32_t num_slots,
             std::uint32_t group_size, Grouping grouping, ClosestHit closest)
    : groups_{{device, "grouped pair ids", num_rays},
              {device, "block rays", max_visible(num_rays, num_slots)}},
      pair_slots_(device, "cache slots of pairs", num_rays),
      gather_(grouping == Grouping::kRadix
                  ? decltype(gather_)(std::in_place_type<ByRadix>, device, num_rays, num_slots,
                                      group_size, closest)
                  : decltype(gather_)(std::in_place_type<ByCounting>, device, num_rays, num_slots,
                                      group_size, closest)) {}

void Group::operator()(const BlockCache &cache, Wavefront &rays) {
  std::visit([&](auto &gather) { gather(cache, rays, pair_slots_, groups_); }, gather_);
}

Group::ByRadix::ByRadix(ocl::Device &device, std::uint64_t num_rays, std::uint32_t num_slots,
                        std::uint32_t group_size, ClosestHit closest)
    : pair_tiles_range(tiles_range(num_rays, group_size, ISO_GROUP_ITEMS, device)),
      key_tiles_range(tiles_range(num_rays, group_size, ISO_SCAN_ITEMS, device)),
      key_bits(std::max(1, static_cast<int>(std::bit_width(num_slots - 1)))),
      sort(device, num_rays, group_size),
      tile_sums(device, "group tile sums", num_tiles(num_rays, group_size, ISO_SCAN_ITEMS)),
      select(device, "group", "group_select", group_stage_defines(group_size, closest)),
      head_sums(device, "group", "group_head_sums", group_stage_defines(group_size, closest)),
      heads(device, "group", "group_heads", group_stage_defines(group_size, closest)) {}

void Group::ByRadix::operator()(const BlockCache &cache, Wavefront &rays, ocl::Buffer<uint> &keys,
                                BlockGroups &groups) {
  select(pair_tiles_range, rays.frame, rays.counts, rays.pair_block_ids, cache.table,
         rays.pair_hits, rays.closest_pairs, groups.pair_ids, keys);
  sort(keys, groups.pair_ids, rays.counts, ISO_COUNT_FIELD(granted_count), key_bits);
  head_sums(key_tiles_range, rays.counts, keys, tile_sums);
  heads(key_tiles_range, rays.counts, keys, tile_sums, groups.block_rays);
}

Group::ByCounting::ByCounting(ocl::Device &device, std::uint64_t num_rays, std::uint32_t num_slots,
                              std::uint32_t group_size, ClosestHit closest)
    : pair_tiles_range(tiles_range(num_rays, group_size, ISO_GROUP_ITEMS, device)),
      candidates_range(ocl::Range::strided(max_visible(num_rays, num_slots), group_size, device)),
      pairs_range(ocl::Range::strided(num_rays, ocl::kGroupSize, device, 2)),
      slot_counts(device, "pairs by slot", num_slots),
      slot_offsets(device, "pair offsets by slot", num_slots),
      candidate_count(device, "group candidates", 1),
      count(device, "group", "group_count", group_stage_defines(group_size, closest)),
      blocks(device, "group", "group_blocks", group_stage_defines(group_size, closest)),
      scatter(device, "group", "group_scatter", group_stage_defines(group_size, closest)) {}

void Group::ByCounting::operator()(const BlockCache &cache, Wavefront &rays,
                                   ocl::Buffer<uint> &pair_slots, BlockGroups &groups) {
  ocl::Buffer<uint> &pair_ranks = rays.mask, &candidate_slots = groups.pair_ids;  // not in use yet
  count(pair_tiles_range, rays.frame, rays.counts, rays.pair_block_ids, cache.table, pair_slots,
        pair_ranks, slot_counts, candidate_slots, candidate_count);
  blocks(candidates_range, rays.frame, rays.counts, candidate_slots, candidate_count,
         cache.slot_block_ids, cache.table, slot_counts, slot_offsets, groups.block_rays);
  scatter(pairs_range, rays.counts, rays.pair_block_ids, pair_slots, pair_ranks, slot_offsets,
          rays.pair_hits, rays.closest_pairs, groups.pair_ids, candidate_count);
}

}  // namespace isowave::core
