#pragma once
// The picture that a frame should be: many rays a pixel through the voxels before compression, with
// smooth normals and the lights of kernels_cl/portable/shade.h, all in double precision. It shares
// no code with the renderers.

#include <cstdint>

#include "core/frame/appearance.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "reference/grid_oracle.hpp"

namespace isowave::core {

enum class Sky {
  kOpen,  ///< light from the sky reaches every hit
  kSeen   ///< each ray's hit looks at the sky in one direction: pictures with ambient rays
};

/// Draws with all threads.
///
/// info      the grid of the oracle's voxels
/// size      size.samples: rays of a pixel along each axis, in the middles of as many equal parts
/// Returns   RGB; a pixel's colour is the mean of its rays' display values
Image8 truth_picture(const GridOracle &oracle, const VolumeInfo &info, const Camera &camera,
                     ImageSize size, Sky sky = Sky::kOpen, const Appearance &appearance = {});

}  // namespace isowave::core
