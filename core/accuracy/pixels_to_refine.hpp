#pragma once
// The pixels for which one ray is not enough.

#include <cstdint>
#include <span>
#include <vector>

#include "core/view/frame.hpp"

namespace isowave::core {

/// Pixels are refined if a channel of theirs differs by more than this from that of a neighbour. A
/// judgement: less refines noise, more leaves jagged edges.
inline constexpr int kLargestDifference = 16;

/// The pixels that differ from one of their eight neighbours by more than kLargestDifference:
/// silhouettes, folds, and what is smaller than a pixel.
///
/// size  its pixels count, its samples do not
/// rgb   [height][width][3], row 0 at the top
/// Returns  row * width + column, ascending
std::vector<std::uint32_t> pixels_to_refine(ImageSize size, std::span<const std::uint8_t> rgb);

}  // namespace isowave::core
