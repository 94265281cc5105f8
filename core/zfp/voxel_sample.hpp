#pragma once
// Some of a compressed volume's voxels, for histograms and the like.

#include <cstdint>
#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Decodes blocks that are spread over the volume, always the same ones; all blocks if they have at
/// most max_voxels voxels.
///
/// Returns  their voxels without padding, about max_voxels, in no order that means anything
/// Throws   Error: a file is shorter than it was, or cannot be read
std::vector<float> sample_voxels(const CompressedVolume &volume, std::uint64_t max_voxels);

}  // namespace isowave::core
