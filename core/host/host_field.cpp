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
    const ulong block = level_block_at(&grid, x / 4, y / 4, z / 4);
    corners[c] = decoded.values[ISO_BLOCK_VOXELS * block + x % 4 + 4 * (y % 4) + 16 * (z % 4)];
  }
  return value_of_hit(&map, label_table, hit, corners, place.at);
}

HostFieldValues::HostFieldValues(const CompressedVolume &field, HostBlocks *drawn,
                                 std::span<const VolumeInfo> levels, HostRoom &room,
                                 std::uint32_t num_threads)
    : field_(field),
      drawn_(drawn),
      room_(room),
      num_threads_(num_threads),
      range_(known_range(field)),
      map_(make_field_map(levels, field.info)),
      reading_{map_},
      grid_(make_grid_params(field.info)) {
  if (drawn == nullptr) own();
}

HostBlocks &HostFieldValues::own() {
  if (!own_) own_ = std::make_unique<HostBlocks>(field_, room_, num_threads_);
  return *own_;
}

/// Whether the frame decodes the drawn volume's blocks to the values of the field.
bool HostFieldValues::shares_in(const FrameRequest &request) const {
  return drawn_ != nullptr && draws_own_values(request);
}

std::uint64_t HostFieldValues::own_bytes(const FrameRequest &request) const {
  return own_ || !shares_in(request) ? HostBlocks::bytes(field_.info) : 0;
}

void HostFieldValues::begin_frame(const FrameRequest &request) {
  reading_ = reading_of(request, map_, drawn_ != nullptr);
  HostBlocks &blocks = shares_in(request) ? *drawn_ : own();
  blocks.decode_as(HostValues(field_));
  decoded_ = blocks.field();
}

void HostFieldValues::operator()(std::span<const HitRecord> hits, float *values) const {
  for (std::size_t i = 0; i < hits.size(); ++i)
    values[i] = value_at_hit(reading_.map, grid_, decoded_, hits[i], reading_.label_table.data());
}

}  // namespace isowave::core
