#pragma once
// The view that is taken where nobody asks for another.

#include <optional>
#include <span>

#include "core/stages/macrocells.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The box around the blocks that isosurfaces may be in, by the blocks' ranges of values; none
/// where they are in no block. The same for all devices.
///
/// macrocells  of the volume's finest level, of which info is the grid
/// isovalues   one or more
/// Throws      Error: NaN
/// Waits       yes
std::optional<BlockBox> surface_box(Macrocells &macrocells, const VolumeInfo &info,
                                    std::span<const float> isovalues);

/// A view in which that box fills a picture of that size; none: the whole volume. From where
/// orbit_cameras() begins.
Camera surface_camera(const VolumeInfo &info, const std::optional<BlockBox> &box, ImageSize size);

/// Both without a renderer: builds the blocks' ranges on the device, and forgets them.
Camera surface_camera(ocl::Device &device, const CompressedVolume &volume,
                      std::span<const float> isovalues, ImageSize size);

}  // namespace isowave::core
