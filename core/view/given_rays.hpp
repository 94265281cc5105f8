#pragma once
// Rays of any origin, from world space to what kernels and host loops trace.

#include <cstdint>
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
  GivenRay ray;   ///< of a WorldRay, its direction's largest component is from 1/2 to below 1
  float t_scale;  ///< power of two: t of the kernels -> t of the world ray
};

/// Throws  Error: a ray is not finite, has no direction, or begins more than 1e7 voxels away from
///         the volume's origin
std::vector<IndexRay> make_index_rays(const VolumeInfo &info, std::span<const WorldRay> rays);

/// The rays of some pixels, bit for bit those of the frame's picture (make_ray()).
///
/// frame    of the finest level of detail
/// samples  rays of a pixel along each axis
/// pixels   row * width + column of the picture
/// Returns  [pixel][samples][samples]
std::vector<IndexRay> make_pixel_rays(const FrameParams &frame, std::uint32_t samples,
                                      std::span<const std::uint32_t> pixels);

}  // namespace isowave::core
