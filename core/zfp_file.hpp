#pragma once
// The `.zfp` file: zfp's header and stream, then a trailer with what zfp cannot say.
//
//   bytes  0..11   zfp full header, short form (96 bits)
//         12..     payload, then zeros to a multiple of 8 bytes: here a file of zfp's own tool ends
//                  only at fixed accuracy: the length of each block in bits, uint16, deflated (zlib)
//                  only in a level of detail: the bound of each block's error (block_bound.h), uint8, deflated
//                  only with levels of detail: a whole such file for each coarser level
//                  JSON text: spacing, origin, direction, type, value_range, max_error; at fixed accuracy also payload_bits,
//                  index_bytes (deflated), whole_numbers; with bounds also
//                  bounds_bytes (deflated), bounds_exponent, bounds_by_place; with levels also level_bytes, a list
//         the last 24 bytes, little endian:
//                  uint32 version (1; 2 at fixed accuracy; 4 with levels, or 3, without bounds) | uint32 length of the JSON text | uint32 CRC-32 of all before the
//                  JSON text | uint32 CRC-32 of the JSON text and the three numbers before | magic "ISOWAVE\n"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "core/io/atomic_file.hpp"
#include "core/zfp_stream.hpp"

namespace isowave {

/// Writes a `.zfp` file front to back, its levels of detail beside each other; nothing is left behind without commit().
class ZfpFileWriter {
 public:
  /// Writes the headers of volume and of its coarser levels, from their info.dims and bits_per_block (a multiple of 64), or
  /// error_bound.
  ZfpFileWriter(const std::filesystem::path &path, const CompressedVolume &volume);
  /// Appends payload of the volume (level 0) or of coarser level `level`.
  void write(std::span<const std::byte> payload, std::size_t level = 0);
  /// Pads, writes indices and trailers from all fields but words, and renames the file into place.
  void commit(const CompressedVolume &volume);

 private:
  /// A level's file.
  struct Part {
    explicit Part(const std::filesystem::path &path) : file(path) {}
    void write(std::span<const std::byte> bytes);
    std::uint64_t write_index(const CompressedVolume &volume);
    std::uint64_t write_bounds(const CompressedVolume &volume);
    template <typename T>
    std::uint64_t write_deflated(const std::function<std::span<const T>()> &next);
    void write_trailer(const std::string &text, std::uint32_t version);

    AtomicFile file;
    std::uint32_t crc = 0;
    std::uint64_t size = 0;
  };

  std::deque<Part> parts_;  ///< the coarser ones only until they are joined to the first
};

}  // namespace isowave
