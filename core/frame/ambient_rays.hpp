#pragma once
// Ambient rays of a hit, which find out how much of the sky it sees.

#include <cstdint>
#include <vector>

#include "core/volume/volume.hpp"
#include "kernels_cl/portable/ambient.h"

namespace isowave::core {

/// Throws  Error: more rays than ISO_MAX_AMBIENT_RAYS
void check_ambient_rays(std::uint32_t num_rays);

/// info: the finest level of detail that draws the frame.
AmbientParams make_ambient_params(const VolumeInfo &info);

/// Returns  [num_rays][ISO_AMBIENT_PATTERNS], distributed by their cosine with z: point k + (p +
///          1/2) / ISO_AMBIENT_PATTERNS of a spiral, turned by p / ISO_AMBIENT_PATTERNS
std::vector<AmbientDirection> make_ambient_directions(std::uint32_t num_rays);

}  // namespace isowave::core
