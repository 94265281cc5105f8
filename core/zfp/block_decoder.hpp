#pragma once
// Blocks of a compressed volume, decoded on the host wherever the volume is.

#include <cstdint>
#include <span>
#include <vector>

#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// Decodes blocks of a volume, which must outlive it. For one thread.
class BlockDecoder {
 public:
  explicit BlockDecoder(const CompressedVolume &volume) : volume_(volume) {}

  /// Makes blocks [first, first + count) ready: reads them at once, if they are in a file.
  ///
  /// Throws  Error: the file is shorter than it was, or cannot be read
  void load(std::uint64_t first, std::uint64_t count);
  /// The voxels x + 4 y + 16 z of a block that is ready, with padding; voxels without data are NaN.
  ///
  /// Throws  ChunkIsMissing: of a volume in chunks
  void decode(std::uint64_t id, std::span<float, ISO_BLOCK_VOXELS> voxels) const;

 private:
  const CompressedVolume &volume_;
  std::vector<std::uint32_t> read_{};  ///< words that were read from a file
  std::uint64_t first_bit_ = 0;        ///< bit of the payload at which read_ begins
};

}  // namespace isowave::core
