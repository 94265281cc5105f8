#include "core/stages/field_values.hpp"

#include <cstring>

namespace isowave::core {

FieldValues::FieldValues(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t group_size,
                         SlotType slots, std::uint32_t num_labels, std::size_t num_maps)
    : device_(device),
      range_of_hits_(
          ocl::Range::strided(num_pixels, group_size, device, 4).in_parts(num_pixels, device)),
      map_(device, sizes(num_labels, num_maps)["map of a field"]),
      label_table_(device, sizes(num_labels)["labels of surfaces"]),
      range_(device, sizes(num_labels)["range of field values"]),
      kernel_(device, with_slots(group_defines(group_size), slots), num_maps > 1),
      range_kernel_(device, with_slots(group_defines(group_size), slots)) {}

void FieldValues::set_maps(std::span<const FieldMap> maps, const std::vector<uint> &label_table) {
  if (maps.front().labels == ISO_FIELD_OWN_LABELS && label_table != labels_on_device_) {
    label_table_.write(label_table);
    labels_on_device_ = label_table;
  }
  if (maps.size() == maps_on_device_.size() &&
      std::memcmp(maps_on_device_.data(), maps.data(), maps.size_bytes()) == 0)
    return;
  map_.write(maps);
  maps_on_device_.assign(maps.begin(), maps.end());
}

void FieldValues::operator()(const FrameParams &frame, BlockCache &cache, Wavefront &rays,
                             bool begins) {
  kernel_.of(rays)(range_of_hits_, frame, rays.level_frames, rays.num_level_frames, map_,
                   label_table_, range_of_hits_.parts, begins ? 1u : 0u, cache.table, cache.values,
                   rays.previous_counts, rays.counts, rays.next_counts, rays.active_ray_ids,
                   rays.next_active_ray_ids, rays.hits, rays.field_values, cache.slot_stamps,
                   cache.requested_bits, cache.request_block_ids, cache.capacity, cache.state);
}

std::optional<std::array<float, 2>> FieldValues::range(const Wavefront &rays,
                                                       std::size_t num_rays) {
  const std::array<uint, 2> none{0xFFFFFFFFu, 0};
  range_.write(none);
  range_kernel_(ocl::Range::strided(num_rays, ocl::kGroupSize, device_),
                static_cast<uint>(num_rays), rays.field_values, range_);
  std::array<uint, 2> keys{};
  range_.read(keys);
  if (keys == none) return {};
  return {{value_of_key(keys[0]), value_of_key(keys[1])}};
}

}  // namespace isowave::core
