#pragma once
// Float32 images as numpy files: depth, and anything else that must keep its bits.

#include <cstdint>
#include <filesystem>
#include <vector>

namespace isowave::core {

/// float32 [height][width], row 0 at the top. A depth image holds the distance from the eye in
/// world units, and +inf where nothing is hit.
struct FloatImage {
  std::uint32_t width = 0, height = 0;
  std::vector<float> pixels;
};

/// Writes numpy format 1.0: '<f4', C order, shape (height, width); every bit is kept. Writes to a
/// temporary name and renames.
///
/// Throws  Error: it cannot write; std::invalid_argument: pixels is not width * height long
void write_npy(const FloatImage &image, const std::filesystem::path &path);

/// Reads a two-dimensional '<f4' array in C order of numpy format 1, 2 or 3.
///
/// Throws  Error, in one line: unreadable, not .npy, another type, order or rank, fewer or more
///         bytes than the shape says
FloatImage read_npy(const std::filesystem::path &path);

}  // namespace isowave::core
