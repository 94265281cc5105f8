#pragma once
// Volumes whose blocks come from afar: a file in which the blocks of a macrocell (4^3 blocks) lie
// together, a chunk, so that a reader on the other side of a network can ask for what rays come to.
// The head of the file has the value range of each macrocell. README.md of this folder describes
// the file.

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Thrown by what needs a chunk that is not there yet. The chunk is noted: see take_missing().
struct ChunkIsMissing {};

/// Value ranges of the cells of macrocells, x fastest; low > high: a macrocell has no cells.
struct MacrocellRanges {
  std::vector<float> low, high;
};

/// Bytes [begin, end) of a file.
struct FilePart {
  std::uint64_t begin = 0, end = 0;
  bool operator==(const FilePart &) const = default;
};

/// The chunks of a level of detail that are there. For one thread.
class BlockChunks {
 public:
  /// A block of a chunk.
  struct Block {
    const std::uint32_t *words;  ///< kDecoderAhead words behind its last bit are there, too
    std::uint64_t first_bit;
    std::uint32_t num_bits;
    std::uint64_t no_data;  ///< bit x + 4y + 16z: the voxel has no data
  };
  /// What the file's head says of a level.
  struct Layout {
    glm::uvec3 num_blocks;
    std::uint32_t bits_per_block;  ///< 0: blocks have lengths of their own
    bool has_gaps;                 ///< voxels without data
    std::uint32_t file_id;
    std::vector<std::uint64_t> begins;  ///< [macrocell in the file's order, and its end]
    MacrocellRanges ranges;             ///< each holds that of its macrocell
  };

  explicit BlockChunks(Layout layout);

  const MacrocellRanges &ranges() const { return layout_.ranges; }
  /// Whether the chunk of a block is there. If not, it is noted as missing.
  bool is_there(std::uint64_t block);
  /// Throws  ChunkIsMissing
  Block block(std::uint64_t block);

  /// Work begins that may need chunks which are not there: the rays of a tile, for example. It may
  /// go on past some of them, as if its block were empty, and so find what else it may need. What
  /// it finds is a guess, and no result.
  ///
  /// most_new  chunks that it may note as missing before it must stop
  void begin_guesses(std::uint32_t most_new);
  /// A chunk is missing, and the work goes on without it.
  ///
  /// Throws  ChunkIsMissing: the work must stop
  void guess();
  /// Whether the work has guessed.
  bool has_guessed() const { return has_guessed_; }

  /// The chunks that were missed since the last call, in the file's order.
  std::vector<FilePart> take_missing();
  /// A chunk's bytes have come.
  ///
  /// begin   of the chunk in the file
  /// Throws  Error: no chunk begins there, or these are not its bytes
  void give(std::uint64_t begin, std::span<const std::byte> bytes);
  /// Whether a chunk of this level begins there.
  bool has_chunk_at(std::uint64_t begin) const;
  /// Drops chunks until the others have at most that many bytes. Those that were asked for since
  /// the last call stay.
  void drop_unused(std::uint64_t most_bytes);
  std::uint64_t bytes() const { return bytes_; }

 private:
  struct Chunk {
    std::vector<std::uint32_t> words;
    std::vector<std::uint32_t> first_bits;  ///< [block of the chunk, and its end]
    std::vector<std::uint64_t> no_data;     ///< [block of the chunk]; empty: all voxels have data
    bool is_used = true;
  };
  struct Place {
    std::uint32_t macrocell, block;  ///< block: its number in the chunk
  };

  Place place_of(std::uint64_t block) const;
  glm::uvec3 size_of(std::uint32_t macrocell) const;
  Chunk unpack(std::uint32_t macrocell, std::span<const std::byte> bytes) const;
  Chunk *find(std::uint32_t macrocell);

  Layout layout_;
  glm::uvec3 macrocells_;
  std::vector<std::uint32_t> order_;   ///< [place in the file] macrocell
  std::vector<std::uint32_t> places_;  ///< [macrocell] place in the file
  std::unordered_map<std::uint32_t, Chunk> chunks_{};
  std::unordered_set<std::uint32_t> missing_{};  ///< places in the file
  std::uint64_t bytes_ = 0;
  std::uint32_t new_ones_left_ = 0;  ///< that the work may note, and go on
  bool has_guessed_ = false;
};

}  // namespace isowave::core
