#include "core/volume/world_positions.hpp"

#include <cmath>

namespace isowave::core {

bool float32_holds_positions(const VolumeInfo &info) {
  const glm::dmat3 to_world = info.index_to_world(), to_index = glm::inverse(to_world);
  const glm::dvec3 last(info.dims - 1u);
  constexpr double kHalfUlp = 0x1p-24;  // of a number, as a part of it at most
  glm::dvec3 error(0.0);                // of a coordinate in the world
  for (int row = 0; row < 3; ++row) {
    double extent = 0;  // largest distance from the origin of the box along this axis
    for (int axis = 0; axis < 3; ++axis) extent += std::abs(to_world[axis][row]) * last[axis];
    error[row] = kHalfUlp * (std::abs(info.origin[row]) + extent);
  }
  for (int axis = 0; axis < 3; ++axis) {
    double voxels = 0;
    for (int row = 0; row < 3; ++row) voxels += std::abs(to_index[row][axis]) * error[row];
    if (!(voxels <= kPositionError)) return false;
  }
  return true;
}

glm::dvec3 rounded_to_float32(const glm::dvec3 &position) {
  return {rounded_to_float(position.x), rounded_to_float(position.y), rounded_to_float(position.z)};
}

WorldMap make_world_map(const VolumeInfo &info) {
  WorldMap map{};
  const glm::dmat3 to_world = info.index_to_world();
  for (int row = 0; row < 3; ++row) {
    map.origin[row] = info.origin[row];
    for (int axis = 0; axis < 3; ++axis) map.to_world[3 * row + axis] = to_world[axis][row];
  }
  return map;
}

WorldPositions::WorldPositions(const VolumeInfo &info)
    : map_(make_world_map(info)), is_float32_(float32_holds_positions(info) ? 1 : 0) {}

glm::dvec3 WorldPositions::operator()(const glm::dvec3 &index) const {
  glm::dvec3 position;
  world_position(&map_, is_float32_, index.x, index.y, index.z, &position.x);
  return position;
}

}  // namespace isowave::core
