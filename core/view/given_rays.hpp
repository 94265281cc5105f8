#pragma once
// Rays of any origin, from world space to what kernels and host loops trace.

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/volume/volume.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// A ray in world space: origin + t direction, t from 0 on.
struct WorldRay {
  glm::dvec3 origin, direction;
};

/// A WorldRay in the index space of the finest level of detail.
struct IndexRay {
  GivenRay ray;   ///< the largest component of its direction is from 1/2 to below 1
  float t_scale;  ///< power of two: t of the kernels -> t of the world ray
};

/// Throws  Error: a ray is not finite, has no direction, or begins more than 1e7 voxels away from
///         the volume's origin
std::vector<IndexRay> make_index_rays(const VolumeInfo &info, std::span<const WorldRay> rays);

}  // namespace isowave::core
