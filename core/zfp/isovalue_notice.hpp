#pragma once
// What a user should know of an isovalue before looking for its surface.

#include <string>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// One line if no voxel of the source is below the isovalue, or none at it or above: it says the
/// range of values. Empty if there can be a surface, or if the range is not known.
std::string isovalue_notice(const CompressedVolume &volume, float isovalue);

}  // namespace isowave::core
