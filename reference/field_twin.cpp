#include "reference/field_twin.hpp"

#include "core/zfp/libzfp.hpp"

namespace isowave::core {

float value_at_hit(const FieldReading &reading, const glm::uvec3 &dims,
                   std::span<const float> voxels, const HitRecord &hit) {
  const FieldMap &map = reading.map;
  const FieldPlace place = field_place(&map, hit);
  if (!is_in_field(place)) return no_value();
  float corners[8];
  for (int c = 0; c < 8; ++c) {
    const auto x = static_cast<uint>(place.x + (c & 1)),
               y = static_cast<uint>(place.y + (c >> 1 & 1)),
               z = static_cast<uint>(place.z + (c >> 2));
    corners[c] = voxels[x + std::size_t{dims.x} * (y + std::size_t{dims.y} * z)];
  }
  return value_of_hit(&map, reading.label_table.data(), hit, corners, place.at);
}

FieldTwin::FieldTwin(const CompressedVolume &field)
    : info_(field.info), range_(known_range(field)), voxels_(decode_with_libzfp(field)) {}

std::vector<float> FieldTwin::values(std::span<const VolumeInfo> levels,
                                     std::span<const HitRecord> hits,
                                     const FrameRequest &request) const {
  const FieldReading reading = reading_of(request, make_field_map(levels, info_), false);
  std::vector<float> values(hits.size(), no_value());
  for (std::size_t i = 0; i < hits.size(); ++i)
    values[i] = value_at_hit(reading, info_.dims, voxels_, hits[i]);
  return values;
}

}  // namespace isowave::core
