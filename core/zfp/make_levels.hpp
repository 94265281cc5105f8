#pragma once
// Levels of detail of a volume that was compressed without.

#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The coarser levels that a volume can have, from its decoded voxels, with the precision of its
/// own blocks. Their errors are not measured. Memory: the levels, a seventh of the volume, and some
/// layers of its voxels.
///
/// Throws  Error: a file that the volume is in cannot be read
std::vector<CompressedVolume> make_levels(const CompressedVolume &volume);

}  // namespace isowave::core
