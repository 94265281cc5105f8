#include "core/frame/field_values.hpp"

#include <algorithm>

#include "core/view/detail.hpp"
#include "core/volume/pyramid.hpp"

namespace isowave::core {

FieldMap make_field_map(std::span<const VolumeInfo> levels, const VolumeInfo &field) {
  static_assert(ISO_FIELD_LEVELS == kMaxLevels);
  const VolumeInfo &volume = levels.front();
  const glm::dmat3 to_field = glm::inverse(field.index_to_world());
  const glm::dmat3 turn = to_field * volume.index_to_world();
  const glm::dvec3 begin = to_field * (volume.origin - field.origin);
  FieldMap map{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      map.rows[4 * row + column] = static_cast<float>(turn[column][row]);
    map.rows[4 * row + 3] = static_cast<float>(begin[row]);
    map.dims[row] = field.dims[row];
  }
  set_level_places(levels, map);
  return map;
}

std::optional<std::array<float, 2>> range_of_values(std::span<const float> values) {
  std::optional<std::array<float, 2>> range;
  for (const float value : values) {
    if (is_no_data(value)) continue;
    if (!range) range = {value, value};
    range = {{std::min((*range)[0], value), std::max((*range)[1], value)}};
  }
  return range;
}

}  // namespace isowave::core
