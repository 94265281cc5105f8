#pragma once
// Compressed volumes: a standard zfp stream of 4^3 float32 blocks, at a fixed number of bits per
// block or with as many as a bound of the error needs, and what zfp's header cannot say. Block
// (bx,by,bz) is number bx + nbx*(by + nby*bz).

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/volume/voxel_chunks.hpp"
#include "core/zfp/no_data.hpp"
#include "kernels_cl/portable/block_index.h"

namespace isowave::core {

class BlockChunks;
class InputFile;
class LevelCoder;
struct CompressOptions;

/// Takes a level's payload in order.
using PayloadSink = std::function<void(std::span<const std::byte>)>;
/// Makes the coder of a level of those dims. keep_errors: keeps the errors of each block.
using CoderMaker = std::function<std::unique_ptr<LevelCoder>(
    const glm::uvec3 &dims, const CompressOptions &options, const PayloadSink &sink,
    bool keep_errors)>;

/// The precision of a volume whose blocks have lengths of their own.
struct BlockPrecision {
  /// Bit planes of blocks end where zfp can promise an error of at most 2^min_exponent (its
  /// fixed-accuracy mode). ISO_REVERSIBLE: nothing is lost of float32 (its reversible mode).
  std::int32_t min_exponent = ISO_ALL_PLANES;
  bool whole_numbers = false;               ///< decoded values are rounded to the source's integers
  std::optional<double> max_voxel_error{};  ///< largest |decoded - source|, measured

  bool is_reversible() const { return min_exponent == ISO_REVERSIBLE; }
};

/// Drops the bit planes that an error of at most voxel_error allows to leave out. 0 drops none.
/// Blocks of reversible streams can spare none. Whole numbers stay whole, so an error below 1 drops
/// none of theirs.
BlockPrecision with_fewer_planes(const BlockPrecision &bound, double voxel_error);

/// The integers that decoded values are rounded to (kernels_cl/portable/whole_number.h).
struct WholeNumbers {
  float least = 1, greatest = 0;  ///< least > greatest: values are not rounded
  bool operator==(const WholeNumbers &) const = default;
};
/// Those of blocks of this precision in a volume of this type.
WholeNumbers whole_numbers_of(VoxelType type, const BlockPrecision &precision);
void round_to(const WholeNumbers &whole, std::span<float> values);

struct CompressOptions {
  std::uint32_t rate = 0;  ///< bits per voxel, 1..32; or
  std::optional<BlockPrecision>
      precision{};  ///< as many bits as each block needs: see choose_precision()
  /// Compresses the finest level at a fixed rate, with libzfp's bits: encoder_on() of a device
  /// (core/stages/zfp_encode.hpp). None: libzfp.
  CoderMaker encoder{};
  bool measure_error =
      false;  ///< at a fixed rate: decode everything again for CompressedVolume::max_voxel_error
  std::uint32_t levels =
      1;  ///< of detail, the volume itself among them, 1..max_levels(); 0: max_levels()
  InputOptions input{};
};

/// How far the field of a level of detail may be from that of the volume before compression, by
/// block: codes of kernels_cl/portable/block_bound.h, in units of 2^exponent.
struct BlockBounds {
  std::vector<std::uint8_t> codes{};
  std::int32_t exponent = 0;
  /// Whether a voxel is off by at most its share (bound_share()) of the block's bound: only if
  /// voxels are compared with the source's.
  bool by_place = false;
  /// A brick's level: the largest code in all bricks, which decides what float32 loses.
  std::uint8_t largest_of_whole = 0;
};

/// CompressedVolume::value_range of a volume whose values are not known.
inline constexpr std::array<float, 2> kUnknownRange = {-std::numeric_limits<float>::infinity(),
                                                       std::numeric_limits<float>::infinity()};

/// Most words past a block's last bit that a decoder reads.
inline constexpr std::uint64_t kDecoderAhead = 2;

/// A zfp volume in host memory or in a file, at a fixed rate, or with blocks as long as the error
/// demands.
struct CompressedVolume {
  VolumeInfo info;  ///< type is that of the source before compression
  /// 64 * rate; from other writers 9..2048 (1 + 8 bits hold the exponent). 0: blocks have lengths
  /// of their own.
  std::uint32_t bits_per_block = 0;
  BlockPrecision precision{};  ///< at a fixed rate, as it is from the start
  std::vector<std::uint32_t>
      index{};  ///< places where blocks with lengths of their own begin: block_index.h
  std::uint64_t indexed_bits = 0;  ///< length of all of them
  /// Payload from bit 0, little endian; two zero words follow the last bit. Empty if `file` is set.
  std::vector<std::uint32_t> words;
  std::shared_ptr<const InputFile> file{};  ///< holds the payload instead of `words`
  std::uint64_t file_first_bit = 0;         ///< first bit of the payload in the file
  /// The payload comes from afar, chunk by chunk: words, index and file are empty.
  std::shared_ptr<BlockChunks> chunks{};
  NoData no_data{};  ///< its voxels without data
  /// [min, max] of the source's voxels with data, as float32 and after map_nan.
  std::array<float, 2> value_range = kUnknownRange;
  /// Largest |decoded - source| of voxels with data, if it was measured. An error that a device has
  /// measured may be larger: it includes voxels without data.
  std::optional<double> max_voxel_error{};
  BlockBounds bounds{};  ///< bounds of a level of detail; no codes: not known
  /// Whether a file states max_voxel_error and bounds of all levels: its writer may be wrong, or
  /// lie. false: this process measured them.
  bool errors_are_stated = false;
  /// Levels of detail, each of half the voxels along each axis: pyramid.hpp.
  std::vector<CompressedVolume> coarser_levels{};

  glm::uvec3 num_blocks() const { return (info.dims + 3u) / 4u; }
  std::uint64_t block_count() const {
    const glm::uvec3 n = num_blocks();
    return std::uint64_t(n.x) * n.y * n.z;
  }
  bool is_indexed() const { return bits_per_block == 0; }
  std::uint64_t payload_bits() const;
  std::uint64_t block_begin(
      std::uint64_t block_id) const;  ///< bit of the payload; of block_count(): its end
  std::uint32_t block_bits(std::uint64_t block_id) const;  ///< length of a block
  std::uint32_t max_block_bits() const {
    return is_indexed() ? ISO_MAX_BLOCK_BITS : bits_per_block;
  }
  /// Bits per voxel, with the padding of partial blocks, without the index.
  double rate() const { return double(payload_bits()) / (64.0 * double(block_count())); }
  /// Size of `words`, also if the payload is in a file.
  std::uint64_t word_count() const;
  /// Copies 32 * out.size() bits of the payload from bit `bit` on, wherever it is; zeros behind its
  /// end.
  ///
  /// Throws  Error: a file is shorter than it was, or cannot be read
  void read_words(std::uint64_t bit, std::span<std::uint32_t> out) const;
};

/// Copies bits [bit, bit + count) of `bytes`, little endian, to `out`, which is large enough; the
/// rest of `out` becomes 0.
void copy_bits(std::span<const std::byte> bytes, std::uint64_t bit, std::uint64_t count,
               std::span<std::uint32_t> out);

/// Gives a volume, and its coarser levels, another spacing.
void set_spacing(CompressedVolume &volume, const glm::dvec3 &spacing);

/// Compresses a volume in memory, layer by layer.
///
/// Throws  Error: bad rate, NaN, short file, more levels than it can have
CompressedVolume compress(VolumeReader &reader, const CompressOptions &options);
/// As compress(), but straight to a file. Memory is O(nx * ny), and with levels 5 bytes a block (9
/// if float32 does not hold all voxels). Writes to a temporary name and renames; leaves nothing
/// behind on an error. Returns the volume that was written, with empty words.
CompressedVolume compress_to_file(VolumeReader &reader, const CompressOptions &options,
                                  const std::filesystem::path &path);

/// Writes a volume as compress_to_file() does.
///
/// Throws  Error: blocks of a fixed rate that is not a multiple of 1 bit a voxel (other writers'
///         files), or the file cannot be written
void write_zfp_file(const CompressedVolume &volume, const std::filesystem::path &path);

/// Reads a `.zfp` file of ours or any 3D float zfp file of fixed rate or fixed accuracy with a full
/// header (spacing 1 then).
///
/// Throws  Error, in one line: a broken header, other types or modes, truncation, checksum mismatch
CompressedVolume read_zfp_file(const std::filesystem::path &path);
/// As read_zfp_file(), but leaves the payload in the file, to be read when it is needed: words
/// stays empty. The checksum is checked once, here.
CompressedVolume open_zfp_file(const std::filesystem::path &path);
/// As open_zfp_file(), with all its checks, but keeps nothing that grows with the number of blocks:
/// words and index stay empty, and of a level's bounds only the largest is there.
CompressedVolume check_zfp_file(const std::filesystem::path &path);
/// As check_zfp_file(), but neither reads nor checks the payload, index and bounds.
CompressedVolume read_zfp_file_info(const std::filesystem::path &path);

/// Decodes everything with libzfp: [nz][ny][nx] float32; voxels without data are NaN. Uses as few
/// bit planes as voxel_error allows: see with_fewer_planes(). The ground truth of every decoder
/// here.
std::vector<float> decode_with_libzfp(const CompressedVolume &volume, double voxel_error = 0);

}  // namespace isowave::core
