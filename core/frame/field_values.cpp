#include "core/frame/field_values.hpp"

#include <algorithm>
#include <cstring>

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
    map.field_first[row] = static_cast<float>(field.brick.first_voxel[row]);
    map.dims[row] = field.dims[row];
    for (std::size_t level = 0; level < levels.size(); ++level)
      map.first[row][level] = static_cast<float>(levels[level].brick.first_voxel[row]);
  }
  map.surfaces = std::numeric_limits<uint>::max();
  set_level_places(levels, map);
  return map;
}

std::vector<FieldMap> make_own_maps(std::span<const VolumeInfo> levels) {
  std::vector<FieldMap> maps;
  const std::vector<FrameParams> grids = make_level_grids(levels);
  for (std::size_t level = 0; level < levels.size(); ++level) {
    FieldMap &map = maps.emplace_back(make_field_map(levels.subspan(level, 1), levels[level]));
    map.blocks_x = grids[level].place.blocks_x;
    map.blocks_y = grids[level].place.blocks_y;
    map.begin_z[0] = grids[level].place.begin_z;
  }
  return maps;
}

FieldReading reading_of(const FrameRequest &request, const FieldMap &map, bool is_own) {
  FieldReading reading{map};
  reading.map.caps_alone = request.field_on_caps ? 1 : 0;
  reading.map.surfaces = mapped_surfaces(request.surfaces);
  if (!request.field_labels) return reading;
  const bool draws_labels = !request.surfaces.empty() && !request.surfaces.front().labels.empty();
  reading.map.labels = ISO_FIELD_LABELS;
  if (!is_own || !draws_labels) return reading;
  reading.map.labels = ISO_FIELD_OWN_LABELS;
  const LabelTable table = label_table(request.surfaces);
  reading.label_table.resize(table.size() / sizeof(uint));
  std::memcpy(reading.label_table.data(), table.data(), table.size());
  return reading;
}

std::optional<std::array<float, 2>> known_range(const CompressedVolume &volume) {
  if (volume.value_range == kUnknownRange) return {};
  return volume.value_range;
}

Shading make_layer_shading(const VolumeInfo &info, const FrameRequest &request,
                           const std::optional<std::array<float, 2>> &field_range) {
  Appearance light = request.light;
  if (!request.field_values) light.color_by_field.reset();
  const auto &by = light.color_by_field;
  if (by && !by->labels && !(by->low && by->high) && !field_range)
    throw Error(
        "the least and the largest value of the field are not known: give the values of the first "
        "and the last colour");
  return make_shading(info, light, field_range);
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
