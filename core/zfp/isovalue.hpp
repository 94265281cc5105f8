#pragma once
// An isovalue as users give it, and as voxels are compared with it.

#include <span>
#include <string>
#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// One line if compression has made all values 0, since they are below kMinMagnitude: see
/// core/zfp/README.md.
std::string all_zero_notice(const CompressedVolume &volume);

/// One line if no voxel of the source is below the isovalue, or none at it or above: it says the
/// range of values, and whether errors of compression can make a surface. One line, too, if all
/// voxels have become 0 (kMinMagnitude). Empty if the source has a surface, or if the range is not
/// known.
std::string isovalue_notice(const CompressedVolume &volume, double isovalue);

/// The float32 with which decoded voxels are compared: a voxel is inside if it is not below.
///
/// Lossless volumes of a type that float32 holds: the least float32 that is not below `isovalue`,
/// so each voxel is inside if and only if its source is. All others: the nearest float32, as their
/// voxels were rounded.
///
/// Throws  Error: float32 holds no such number
float drawn_isovalue(const CompressedVolume &volume, double isovalue);
std::vector<float> drawn_isovalues(const CompressedVolume &volume,
                                   std::span<const double> isovalues);

}  // namespace isowave::core
