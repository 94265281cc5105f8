#pragma once
// The view that is taken if a user asks for no other.

#include <optional>

#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/voxel_region.hpp"

namespace isowave::core {

/// A view in which a box of blocks fills a picture of that size, from the direction in which
/// orbit_cameras() begins.
///
/// box        the box around the blocks that the surface may be in; none: the whole volume
/// num_views  in each view of turntable(), the box is in the picture
Camera surface_camera(const VolumeInfo &info, const std::optional<BlockBox> &box, ImageSize size,
                      std::uint32_t num_views = 1);

}  // namespace isowave::core
