#pragma once
// The blocks that isosurfaces may be in, by the value ranges that a device computes.

#include <optional>
#include <span>

#include "core/frame/surface_camera.hpp"
#include "core/stages/macrocells.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The box around the blocks that isosurfaces may be in, by the blocks' ranges of values; none if
/// they are in no block. The same for all devices.
///
/// macrocells  of the volume's finest level, of which info is the grid
/// isovalues   one or more
/// Throws      Error: NaN
/// Waits       yes
std::optional<BlockBox> surface_box(Macrocells &macrocells, const VolumeInfo &info,
                                    std::span<const float> isovalues);

/// The view that the surfaces fill. Builds the blocks' ranges on the device, and forgets them.
Camera surface_camera(ocl::Device &device, const CompressedVolume &volume,
                      std::span<const float> isovalues, ImageSize size);

}  // namespace isowave::core
