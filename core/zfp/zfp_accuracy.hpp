#pragma once
// Volumes with a bound on the error: zfp's fixed-accuracy mode, in which blocks are as long as the
// error demands.

#include <optional>
#include <span>
#include <vector>

#include "core/volume/block_errors.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The error that may be made. By default, what float32 cannot hold, and no more.
struct ErrorGoal {
  std::optional<double> tolerance{};  ///< largest |decoded - source| allowed, > 0
  bool exact = false;                 ///< none: values that float32 cannot hold are refused
};

/// The precision that a goal needs.
///
/// By a tolerance: the fewest bit planes with which no voxel exceeds it. zfp's promise is for the
/// worst of all volumes, so up to six planes fewer than it demands are tried on every voxel. What
/// the cast to float32 loses counts (Chunk::lost).
/// Without: of integer types, if all voxels are below 2^24, the fewest bit planes from which
/// decoded values are rounded to the source's. Else reversible.
///
/// Reads the whole volume, but not float32 by default.
///
/// Throws  Error: what read_in_chunks() throws; a tolerance that is not positive, or that float32
///         and zfp cannot keep (names the smallest that they can); `exact`, and a voxel that would
///         be off
BlockPrecision choose_precision(VolumeReader &reader, const ErrorGoal &goal,
                                const InputOptions &options);

/// Builds CompressedVolume::index block by block.
class BlockIndexBuilder {
 public:
  /// Takes the memory that so many blocks need.
  void reserve(std::uint64_t num_blocks) { index_.reserve(block_index_words(num_blocks)); }
  /// bits: length of the next block, at most ISO_MAX_BLOCK_BITS.
  void add(std::uint32_t bits);
  /// The index of all that was added.
  std::vector<std::uint32_t> finish();

 private:
  void note_begin();

  std::vector<std::uint32_t> index_;
  std::uint64_t count_ = 0, position_ = 0, group_begin_ = 0;
};

/// Bits laid end to end.
class BitAppender {
 public:
  /// The lowest `count` bits of `words`.
  void append(std::span<const std::uint64_t> words, std::uint64_t count);
  /// Whole words so far; the caller may clear them.
  std::vector<std::uint64_t> words{};
  /// Fills up the last word with zeros; returns how many bits it had, 0 to 63.
  std::uint32_t pad();

 private:
  void push(std::uint64_t bits, std::uint32_t count);

  std::uint64_t buffer_ = 0;
  std::uint32_t filled_ = 0;
};

/// Compresses chunks as a bound demands; the payload goes to `sink`, in order.
class ErrorBoundCoder : public ChunkCoder {
 public:
  using Sink = std::function<void(std::span<const std::byte>)>;
  /// errors: to be measured.
  ErrorBoundCoder(const glm::uvec3 &dims, const BlockPrecision &bound, const Sink &sink,
                  std::optional<BlockErrors> errors);

  void begin_chunk(const Chunk &chunk) override;
  void code_row(const BlockRow &row, std::uint32_t thread) override;
  void end_chunk(const Chunk &chunk) override;
  /// Hands over the last bits, as words of 32; returns the index.
  std::vector<std::uint32_t> finish();
  std::optional<BlockErrors> &errors() { return errors_; }
  /// The last chunk as it is decoded, in its layout; only if errors are measured.
  std::span<const float> decoded() const { return decoded_; }

 private:
  struct CodedRow {
    BitAppender bits;
    std::vector<std::uint16_t> lengths;  ///< of its blocks
  };

  glm::uvec3 dims_;
  BlockPrecision bound_;
  const Sink &sink_;
  std::optional<BlockErrors> errors_;
  std::span<const float> chunk_{};  ///< the present one's voxels
  std::vector<float> decoded_{};    ///< and what becomes of them
  std::vector<CodedRow> rows_;      ///< of the present chunk
  BitAppender payload_;
  BlockIndexBuilder index_;
};

/// A run of blocks of a payload without an index.
struct FoundBlocks {
  std::uint64_t count = 0;
  std::uint32_t bits = 0;           ///< the length of each block
  std::span<const float> values{};  ///< [64] of a single block, with padding; none: all are 0
};
/// Finds the lengths of all blocks of a fixed-accuracy or reversible payload without an index by
/// decoding it front to back. Calls take() for each run of blocks, in order. volume.indexed_bits
/// must be at least the payload's length.
///
/// Throws  Error, which names `what`: the payload ends too early
void find_block_lengths(const CompressedVolume &volume, const std::string &what,
                        const std::function<void(const FoundBlocks &)> &take);

}  // namespace isowave::core
