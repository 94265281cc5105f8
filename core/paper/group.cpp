#include "core/paper/group.hpp"

#include <algorithm>
#include <bit>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

/// Distinct blocks that a pass's pairs can belong to.
std::uint64_t max_visible(const Group::Limits &limits) {
  return std::min<std::uint64_t>(limits.num_rays, limits.num_slots);
}

std::uint32_t key_bits_for(std::uint32_t num_slots) {
  return static_cast<std::uint32_t>(std::max(1, static_cast<int>(std::bit_width(num_slots - 1))));
}

ocl::Range candidates_range_for(const Group::Limits &limits, const ocl::Device &device) {
  return ocl::Range::strided(max_visible(limits), limits.group_size, device);
}

/// Gives a buffer back, then makes it of another length.
template <class T>
void remake(ocl::Buffer<T> &buffer, const ocl::BufferSizes &sizes, ocl::Device &device) {
  const ocl::BufferSize &size = sizes[buffer.name()];
  { const ocl::Buffer<T> gone = std::move(buffer); }
  buffer = {device, size};
}

/// A launch over the pass's pairs in tiles of group_size * items.
ocl::Range tiles_range(const Group::Limits &limits, std::uint32_t items,
                       const ocl::Device &device) {
  const std::uint64_t tiles = num_tiles(limits.num_rays, limits.group_size, items);
  return ocl::Range::strided(tiles * limits.group_size, limits.group_size, device);
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

ocl::BufferSizes Group::sizes(const Limits &limits) {
  const std::uint64_t rays = limits.num_rays, slots = limits.num_slots;
  ocl::BufferSizes sizes{ocl::buffer_size<uint>("grouped pair ids", rays),
                         ocl::buffer_size<BlockRays>("block rays", max_visible(limits)),
                         ocl::buffer_size<uint>("cache slots of pairs", rays)};
  if (limits.grouping == Grouping::kRadix) {
    const std::uint64_t tiles = num_tiles(rays, limits.group_size, ISO_SCAN_ITEMS);
    return sizes.add(RadixSort::sizes(rays, limits.group_size))
        .add({ocl::buffer_size<uint>("group tile sums", tiles)});
  }
  return sizes.add({ocl::buffer_size<uint>("pairs by slot", slots),
                    ocl::buffer_size<uint>("pair offsets by slot", slots),
                    ocl::buffer_size<uint>("group candidates", 1)});
}

Group::Group(ocl::Device &device, const Limits &limits, ClosestHit closest)
    : Group(device, limits, sizes(limits), group_stage_defines(limits.group_size, closest)) {}

Group::Group(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
             const ocl::Defines &defines)
    : device_(device),
      limits_(limits),
      groups_{{device, sizes["grouped pair ids"]}, {device, sizes["block rays"]}},
      pair_slots_(device, sizes["cache slots of pairs"]),
      gather_(make_gather(device, limits, sizes, defines)) {}

Group::Gather Group::make_gather(ocl::Device &device, const Limits &limits,
                                 const ocl::BufferSizes &sizes, const ocl::Defines &defines) {
  if (limits.grouping == Grouping::kRadix)
    return Gather(std::in_place_type<ByRadix>, device, limits, sizes, defines);
  return Gather(std::in_place_type<ByCounting>, device, limits, sizes, defines);
}

void Group::resize(std::uint32_t num_slots) {
  limits_.num_slots = num_slots;
  const ocl::BufferSizes made = sizes(limits_);
  device_.finish();  // kernels may still use what goes
  remake(groups_.block_rays, made, device_);
  std::visit([&](auto &gather) { gather.resize(limits_, made, device_); }, gather_);
}

void Group::operator()(const BlockCache &cache, Wavefront &rays) {
  std::visit([&](auto &gather) { gather(cache, rays, pair_slots_, groups_); }, gather_);
}

Group::ByRadix::ByRadix(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
                        const ocl::Defines &defines)
    : pair_tiles_range(tiles_range(limits, ISO_GROUP_ITEMS, device)),
      key_tiles_range(tiles_range(limits, ISO_SCAN_ITEMS, device)),
      key_bits(key_bits_for(limits.num_slots)),
      sort(device, limits.num_rays, limits.group_size),
      tile_sums(device, sizes["group tile sums"]),
      select(device, defines),
      head_sums(device, defines),
      heads(device, defines) {}

void Group::ByRadix::resize(const Limits &limits, const ocl::BufferSizes &, ocl::Device &) {
  key_bits = key_bits_for(limits.num_slots);
}

void Group::ByRadix::operator()(const BlockCache &cache, Wavefront &rays, ocl::Buffer<uint> &keys,
                                BlockGroups &groups) {
  select(pair_tiles_range, rays.frame, rays.counts, rays.pair_block_ids, cache.table,
         rays.pair_rays, rays.pair_hits, rays.closest_pairs, groups.pair_ids, keys);
  sort(keys, groups.pair_ids, rays.counts, ISO_COUNT_FIELD(granted_count), key_bits);
  head_sums(key_tiles_range, rays.counts, keys, tile_sums);
  heads(key_tiles_range, rays.counts, keys, tile_sums, groups.block_rays);
}

Group::ByCounting::ByCounting(ocl::Device &device, const Limits &limits,
                              const ocl::BufferSizes &sizes, const ocl::Defines &defines)
    : pair_tiles_range(tiles_range(limits, ISO_GROUP_ITEMS, device)),
      candidates_range(candidates_range_for(limits, device)),
      pairs_range(ocl::Range::strided(limits.num_rays, ocl::kGroupSize, device, 2)),
      slot_counts(device, sizes["pairs by slot"]),
      slot_offsets(device, sizes["pair offsets by slot"]),
      candidate_count(device, sizes["group candidates"]),
      count(device, defines),
      blocks(device, defines),
      scatter(device, defines) {}

void Group::ByCounting::resize(const Limits &limits, const ocl::BufferSizes &sizes,
                               ocl::Device &device) {
  candidates_range = candidates_range_for(limits, device);
  remake(slot_counts, sizes, device);
  remake(slot_offsets, sizes, device);
}

void Group::ByCounting::operator()(const BlockCache &cache, Wavefront &rays,
                                   ocl::Buffer<uint> &pair_slots, BlockGroups &groups) {
  ocl::Buffer<uint> &pair_ranks = rays.mask, &candidate_slots = groups.pair_ids;  // not in use yet
  count(pair_tiles_range, rays.frame, rays.counts, rays.pair_block_ids, cache.table, pair_slots,
        pair_ranks, slot_counts, candidate_slots, candidate_count);
  blocks(candidates_range, rays.frame, rays.counts, candidate_slots, candidate_count,
         cache.slot_block_ids, cache.table, slot_counts, slot_offsets, groups.block_rays);
  scatter(pairs_range, rays.frame, rays.counts, rays.pair_block_ids, pair_slots, pair_ranks,
          slot_offsets, rays.pair_rays, rays.pair_hits, rays.closest_pairs, groups.pair_ids,
          candidate_count);
}

}  // namespace isowave::core
