#pragma once
// Positions in the world, in as many bits as they need.

#include <glm/glm.hpp>

#include "core/volume/volume.hpp"
#include "kernels_cl/portable/world_position.h"

namespace isowave::core {

/// The error of a position that float32 may add [voxels].
inline constexpr double kPositionError = 1.0 / 4096;

/// Whether float32 holds each position in the volume's box to kPositionError. It does up to about
/// 4,096 voxels from the world's origin.
bool float32_holds_positions(const VolumeInfo &info);

/// Each coordinate's float32.
glm::dvec3 rounded_to_float32(const glm::dvec3 &position);

/// From index space to the world, as kernels have it.
WorldMap make_world_map(const VolumeInfo &info);

/// From index space to the world.
class WorldPositions {
 public:
  explicit WorldPositions(const VolumeInfo &info);

  /// Computed in float64. Rounded to float32 if that holds all positions of the volume.
  glm::dvec3 operator()(const glm::dvec3 &index) const;

 private:
  WorldMap map_;
  uint is_float32_;
};

}  // namespace isowave::core
