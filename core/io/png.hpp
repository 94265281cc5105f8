#pragma once
// 8-bit colour images as PNG files.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isowave::core {

/// [height][width][channels] bytes, row 0 at the top; 3 channels are RGB, 4 are RGBA with straight
/// alpha. sRGB.
struct Image8 {
  std::uint32_t width = 0, height = 0;
  std::uint32_t channels = 3;
  std::vector<std::uint8_t> pixels;
};

/// Writes losslessly, to a temporary name that is renamed.
///
/// cameras  text of a camera file, for who compares pictures; empty: the file has none
/// Throws  Error: it cannot write, or a side is 0 or above PNG's limit; std::invalid_argument:
///         channels or the length of pixels is wrong
void write_png(const Image8 &image, const std::filesystem::path &path,
               std::string_view cameras = {});

/// The cameras that write_png() was given; none: the file has none.
///
/// Throws  Error: unreadable
std::optional<std::string> cameras_of_png(const std::filesystem::path &path);

/// The bytes of such a file.
std::vector<std::uint8_t> encode_png(const Image8 &image, std::string_view cameras = {});

/// Reads 8-bit RGB and RGBA as they are; grey, palette and fewer bits are widened without loss.
///
/// Throws  Error, in one line: unreadable, not PNG, truncated or broken, 16 bits per channel (which
///         8 cannot hold)
Image8 read_png(const std::filesystem::path &path);

}  // namespace isowave::core
