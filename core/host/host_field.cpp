#include "core/host/host_field.hpp"

#include "core/view/frame.hpp"

namespace isowave::core {

float value_at_hit(const FieldMap &map, const FrameParams &grid, const HostField &decoded,
                   const HitRecord &hit, const uint *label_table) {
  const FieldPlace place = field_place(&map, hit);
  if (!is_in_field(place)) return no_value();
  const BlockCoords base = field_base(place);
  const uint touched = field_blocks(place);
  std::size_t blocks[8], num_blocks = 0;
  bool all_decoded = true;
  for (uint corner = 0; corner < 8; ++corner) {
    if ((touched >> corner & 1u) == 0) continue;
    const std::size_t block = level_block_at(&grid, base.x + (corner & 1),
                                             base.y + (corner >> 1 & 1), base.z + (corner >> 2));
    blocks[num_blocks++] = block;
    all_decoded = all_decoded && decoded.is_decoded(block);
  }
  if (!all_decoded) decoded.maker->decode({blocks, num_blocks});
  float corners[8];
  for (int c = 0; c < 8; ++c) {
    const auto x = static_cast<uint>(place.x + (c & 1)),
               y = static_cast<uint>(place.y + (c >> 1 & 1)),
               z = static_cast<uint>(place.z + (c >> 2));
    const std::size_t block = level_block_at(&grid, x / 4, y / 4, z / 4);
    corners[c] = decoded.values[ISO_BLOCK_VOXELS * block + x % 4 + 4 * (y % 4) + 16 * (z % 4)];
  }
  return value_of_hit(&map, label_table, hit, corners, place.at);
}

HostFieldValues::HostFieldValues(const CompressedVolume &field, bool is_own,
                                 std::span<const VolumeInfo> levels, HostRoom &room,
                                 std::uint32_t num_threads)
    : range_(known_range(field)),
      is_own_(is_own),
      map_(make_field_map(levels, field.info)),
      reading_{map_},
      grid_(make_grid_params(field.info)),
      blocks_(field, room, num_threads),
      decoded_((blocks_.select(0), blocks_.field())) {}

void HostFieldValues::begin_frame(const FrameRequest &request) {
  reading_ = reading_of(request, map_, is_own_);
}

void HostFieldValues::operator()(std::span<const HitRecord> hits, float *values) const {
  for (std::size_t i = 0; i < hits.size(); ++i)
    values[i] = value_at_hit(reading_.map, grid_, decoded_, hits[i], reading_.label_table.data());
}

}  // namespace isowave::core
