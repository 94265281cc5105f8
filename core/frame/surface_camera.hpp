#pragma once
// Views that surfaces, or the whole volume, fill.

#include <optional>

#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/voxel_region.hpp"

namespace isowave::core {

/// A view in which a box of blocks fills a picture of that size.
///
/// box     the box around the blocks that the surface may be in; none: the whole volume
/// Throws  Error: what camera_of_box() throws
Camera surface_camera(const VolumeInfo &info, const std::optional<BlockBox> &box, ImageSize size,
                      const Viewpoint &from = {});

}  // namespace isowave::core
