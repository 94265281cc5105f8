#pragma once
// Files of chunks (block_chunks.hpp): writing one, and reading its head. README.md of this folder
// describes the file.

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/io/atomic_file.hpp"
#include "core/zfp/block_chunks.hpp"

namespace isowave::core {

struct ChunkFileSize {
  std::uint64_t bytes = 0, head_bytes = 0;
  std::uint32_t id = 0;  ///< tells apart files of different heads
};

/// Writes a volume with its levels of detail.
///
/// levels  the finest first
/// ranges  [level]
/// Throws  Error: the volume's file cannot be read; this one cannot be written
ChunkFileSize write_chunks(std::span<const CompressedVolume *const> levels,
                           std::span<const MacrocellRanges> ranges, AtomicFile &file);

/// The volume of a file with this head, with all levels. Its payload is not there yet: the `chunks`
/// of each level get it.
///
/// num_bytes  of the whole file
/// Throws     Error: it is no such head
CompressedVolume read_chunks_head(std::span<const std::byte> head, std::uint64_t num_bytes);

}  // namespace isowave::core
