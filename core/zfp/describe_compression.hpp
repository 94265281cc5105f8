#pragma once
// How a volume is compressed, in words.

#include <string>
#include <string_view>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// How blocks are stored: reversible, whole numbers, fixed accuracy or fixed rate.
std::string_view compression_mode(const CompressedVolume &volume);
/// Bits per voxel, compression_mode() and, if it was measured, the largest error.
std::string describe_compression(const CompressedVolume &volume);

}  // namespace isowave::core
