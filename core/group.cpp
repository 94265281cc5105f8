#include "core/group.hpp"

#include <algorithm>
#include <bit>

namespace isowave {

namespace {
constexpr std::uint32_t kGroupSize = 64;
}

Group::Group(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t num_slots, std::uint32_t group_size)
    : range_(ocl::Range::strided(num_pixels, kGroupSize, device)),
      key_bits_(std::max(1, static_cast<int>(std::bit_width(num_slots - 1)))),
      groups_{{device, "grouped pair ids", num_pixels},
              {device, "grouped slots", num_pixels},
              {device, "block ray offsets", std::min<std::uint64_t>(num_pixels, num_slots)}},
      sort_(device, num_pixels, group_size),
      select_(device, "group", "group_select"),
      keys_(device, "group", "group_keys"),
      heads_(device, "group", "group_heads") {}

void Group::operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction) {
  select_(range_, rays.frame, rays.counts, rays.pair_block_ids, cache.table, rays.pair_hits, rays.mask);
  compaction.indices(rays.mask, rays.counts, ISO_COUNT_FIELD(pair_slot_count), groups_.pair_ids,
                     ISO_COUNT_FIELD(granted_count));
  keys_(range_, rays.frame, rays.counts, groups_.pair_ids, rays.pair_block_ids, cache.table, groups_.slots);
  sort_(groups_.slots, groups_.pair_ids, rays.counts, ISO_COUNT_FIELD(granted_count), key_bits_);
  heads_(range_, rays.counts, groups_.slots, rays.mask);
  compaction.indices(rays.mask, rays.counts, ISO_COUNT_FIELD(granted_count), groups_.block_ray_offsets,
                     ISO_COUNT_FIELD(visible_count));
}

}  // namespace isowave
