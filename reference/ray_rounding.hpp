#pragma once
// How far the float32 ray of a pixel runs from the camera's exact one. This is no error of the
// intersection, which takes the rounded ray as it is, and is reported apart from those.

#include <span>
#include <vector>

#include "core/view/camera.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

/// Distance of each hit point from the exact ray of its pixel, computed in double [voxels]; nothing
/// for pixels without a hit. hits [height * width] of make_frame_params(info, camera, size, ...).
///
/// Throws  std::invalid_argument: another number of hits
std::vector<double> ray_rounding(const VolumeInfo &info, const Camera &camera, ImageSize size,
                                 std::span<const HitRecord> hits);

}  // namespace isowave::core
