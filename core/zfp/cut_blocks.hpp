#pragma once
// Some blocks of a compressed volume as a volume of their own, bit for bit: nothing is decoded.

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "core/volume/block_box.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Lays rows of blocks along x end to end, those of a box in their order: y, then z.
class BlockCutter {
 public:
  /// whole  the volume that the payload is read from; its index may be missing
  /// box    not empty, within the whole
  BlockCutter(const CompressedVolume &whole, const BlockBox &box);
  /// first_bit  of the row in the whole's payload
  /// lengths    of its blocks [bits]
  void add_row(std::uint64_t first_bit, std::span<const std::uint32_t> lengths);
  /// After the last row: the volume, in words. Its dims and brick.first_voxel are the box's; its
  /// other properties are the whole's.
  CompressedVolume finish();

 private:
  void take_words();

  const CompressedVolume &whole_;
  CompressedVolume cut_;
  BitAppender bits_;
  BlockIndexBuilder index_;
  std::vector<std::uint32_t> row_;   ///< of the payload, as it is read ...
  std::vector<std::uint64_t> wide_;  ///< ... and in words of 64 bits
};

/// Picks the bounds of a box of blocks from the bounds of a level.
class BoundsCutter {
 public:
  /// blocks  of the level, along each axis
  /// box     not empty, within them
  BoundsCutter(const glm::uvec3 &blocks, const BlockBox &box);
  /// The next blocks' codes, in the order of blocks.
  void add(std::span<const std::uint8_t> codes);
  /// After the last block. level: exponent and rule of the codes.
  BlockBounds finish(const BlockBounds &level);

 private:
  glm::uvec3 blocks_, begin_, end_, at_{0};
  BlockBounds cut_;
};

/// The blocks of a box with their bounds, from a volume in memory or in a file, without levels of
/// detail.
///
/// Throws  Error: a file is shorter than it was
CompressedVolume cut_blocks(const CompressedVolume &whole, const BlockBox &box);

/// The same from a `.zfp` file: a box from each of its first levels of detail. Beside the blocks it
/// reads headers, trailers, the lengths of blocks and, with_bounds, all bounds. So the checksum of
/// the payload is not checked.
///
/// Throws  Error as read_zfp_file_info(); a damaged index, damaged bounds; a file of zfp's own tool
///         whose blocks have lengths of their own, since it does not say where they begin
CompressedVolume read_zfp_blocks(const std::filesystem::path &path, std::span<const BlockBox> boxes,
                                 bool with_bounds);

}  // namespace isowave::core
