#pragma once
// The view that is taken where nobody asks for another.

#include <optional>
#include <span>

#include "core/stages/macrocells.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// A view in which isosurfaces fill a picture of that size: of the box of the blocks that they may
/// be in, by the blocks' ranges of values; of the whole volume where they are in none. From where
/// orbit_cameras() begins. The same for all devices.
///
/// macrocells  of the volume's finest level, of which info is the grid
/// isovalues   one or more; all surfaces are in the picture
/// Throws      Error: NaN
/// Waits       yes
Camera surface_camera(Macrocells &macrocells, const VolumeInfo &info,
                      std::span<const float> isovalues, ImageSize size);

/// The same of the box of those blocks; none: of the whole volume.
Camera surface_camera(const VolumeInfo &info, const std::optional<BlockBox> &box, ImageSize size);

/// The same without a renderer: builds the blocks' ranges on the device, and forgets them.
Camera surface_camera(ocl::Device &device, const CompressedVolume &volume,
                      std::span<const float> isovalues, ImageSize size);

}  // namespace isowave::core
