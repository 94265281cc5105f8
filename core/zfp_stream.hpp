#pragma once
// Compressed volumes: a standard zfp stream of 4^3 float32 blocks at a fixed number of bits per block, and
// what zfp's header cannot say. See docs in README "File format".
//
// File: zfp full header (96 bits) | block payload, block (bx,by,bz) at index bx + nbx*(by + nby*bz) |
//       zero padding to a whole 64-bit word | trailer (JSON + checksums, see zfp_file.cpp).

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/volume.hpp"

namespace isowave {

class MappedFile;
namespace ocl {
class Device;
}

/// done and total in voxel layers; called from the calling thread.
using Progress = std::function<void(std::uint32_t done, std::uint32_t total)>;

/// zfp cannot hold every float32 (its block scale is a float32 itself, and decoding overshoots by up to 2x).
/// Voxels of at least kMaxMagnitude are refused; those below kMinMagnitude become 0, so that no decoder
/// ever meets an infinity or a denormal.
inline constexpr float kMaxMagnitude = 0x1p126f;
inline constexpr float kMinMagnitude = 0x1p-97f;

struct CompressOptions {
  std::uint32_t rate = 8;          ///< bits per voxel, 1..32
  std::optional<float> map_nan{};  ///< replaces NaN and +-Inf; unset: refused with count and first position
  Progress progress{};
  ocl::Device *device = nullptr;  ///< encodes there instead of with libzfp: the same result, bit for bit
  bool measure_error = false;     ///< decode everything again for CompressedVolume::max_error
  std::uint32_t num_threads = 0;  ///< 0: one per processor; the result is the same for any number
};

/// A fixed-rate zfp volume in host memory.
struct CompressedVolume {
  VolumeInfo info;                   ///< type is that of the source before compression
  std::uint32_t bits_per_block = 0;  ///< 64 * rate; 9..2048 from other writers (1 + 8 bits hold the exponent)
  std::vector<std::uint32_t>
      words;  ///< payload from bit 0, little endian; two zero words follow the last bit; empty where file is set
  std::shared_ptr<const MappedFile> file{};  ///< holds the payload instead of words ...
  std::uint64_t file_first_bit = 0;          ///< ... from this bit on
  std::array<float, 2> value_range{};  ///< [min, max] of the source voxels, as float32 and after map_nan;
                                       ///< {-inf, inf} when unknown
  std::optional<double> max_error{};   ///< largest |decoded - source| when it was measured

  glm::uvec3 num_blocks() const { return (info.dims + 3u) / 4u; }
  std::uint64_t block_count() const {
    const glm::uvec3 n = num_blocks();
    return std::uint64_t(n.x) * n.y * n.z;
  }
  double rate() const { return bits_per_block / 64.0; }  ///< bits per voxel
  /// Size of words, or what it would be.
  std::uint64_t word_count() const;
  /// Copies 32 * out.size() bits of the payload from bit `bit` on, wherever it is; zeros behind its end. Reads a mapped file
  /// without a look at its size: see MappedFile::check().
  void read_words(std::uint64_t bit, std::span<std::uint32_t> out) const;
};

/// Compresses a volume in memory, layer by layer. Throws Error (bad rate, NaN, short file).
CompressedVolume compress(VolumeReader &reader, const CompressOptions &options);
/// As compress(), but straight to a file and in memory O(nx * ny). Writes to a temporary name and renames;
/// nothing is left behind on an error. Returns what was written, but for the words, which stay empty.
CompressedVolume compress_to_file(VolumeReader &reader, const CompressOptions &options,
                                  const std::filesystem::path &path);

/// Reads a `.zfp` file of ours or any fixed-rate 3D float zfp file with a full header (spacing 1 then).
/// Throws Error in one line on a broken header, other types or modes, truncation, checksum mismatch.
CompressedVolume read_zfp_file(const std::filesystem::path &path);
/// As read_zfp_file(), but leaves the payload in the file, which is mapped into memory: words stays empty. The checksum is
/// checked once, here.
CompressedVolume map_zfp_file(const std::filesystem::path &path);
/// As read_zfp_file(), but neither reads nor checks the payload: words stays empty.
CompressedVolume read_zfp_file_info(const std::filesystem::path &path);

/// Decodes everything with libzfp: [nz][ny][nx] float32. The ground truth of every decoder here.
std::vector<float> decode_with_libzfp(const CompressedVolume &volume);

}  // namespace isowave
