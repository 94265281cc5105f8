#pragma once
// The `.zfp` file: zfp's header and stream, then a trailer with what zfp cannot say.
//
//   bytes  0..11   zfp full header, short form (96 bits)
//         12..     payload, then zeros to a multiple of 8 bytes: here a file of zfp's own tool ends
//                  only at fixed accuracy: the length of each block in bits, uint16, deflated (zlib)
//                  JSON text: spacing, origin, direction, type, value_range, max_error; at fixed accuracy also payload_bits,
//                  index_bytes (deflated), whole_numbers
//         the last 24 bytes, little endian:
//                  uint32 version (1; 2 at fixed accuracy) | uint32 length of the JSON text | uint32 CRC-32 of all before the
//                  JSON text | uint32 CRC-32 of the JSON text and the three numbers before | magic "ISOWAVE\n"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "core/io/atomic_file.hpp"
#include "core/zfp_stream.hpp"

namespace isowave {

/// Writes a `.zfp` file front to back; nothing is left behind without commit().
class ZfpFileWriter {
 public:
  /// Writes the header from volume.info.dims and volume.bits_per_block (a multiple of 64), or volume.error_bound.
  ZfpFileWriter(const std::filesystem::path &path, const CompressedVolume &volume);
  /// Appends payload.
  void write(std::span<const std::byte> payload);
  /// Pads, writes the trailer from all fields but words, and renames the file into place.
  void commit(const CompressedVolume &volume);

 private:
  std::uint64_t write_index(const CompressedVolume &volume);

  AtomicFile file_;
  std::uint32_t crc_ = 0;
  std::uint64_t size_ = 0;
};

}  // namespace isowave
