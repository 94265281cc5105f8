#pragma once
// Compares the values and errors that a file states with its own blocks. Only contradictions to the
// blocks are found: the source is not there, so an error against it may still be a lie.

#include <array>
#include <string>

#include "core/volume/voxel_chunks.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Values that the volume's finest level decodes to, least and largest, against value_range and
/// the voxels' error. Nothing is checked if one of these is not known.
///
/// Throws  Error: decoded values are farther outside of the range than the error allows
void check_value_range(const CompressedVolume &volume, const std::array<float, 2> &decoded);

/// Decodes all levels on the host, a few layers at a time: check_value_range(), and of each coarser
/// level that the distance of its field from the next finer level's voxels is no more than both
/// levels' bounds together.
///
/// volume    of a file
/// progress  of the finest level
/// Throws    Error: the file contradicts itself, is shorter than it was, or cannot be read
void check_stated_errors(const CompressedVolume &volume, const Progress &progress);

}  // namespace isowave::core
