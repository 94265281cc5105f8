#pragma once
// What tests of several stages need: awkward sizes, counts on the device, volumes compressed by
// libzfp alone.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

#include "core/stages/device_counts.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/shared_types.h"
#include "kernels_cl/portable/shared_types_fields.h"

namespace isowave::core {

/// std::mt19937, but its numbers are of 32 bits also by type.
using Random =
    std::mersenne_twister_engine<std::uint32_t, 32, 624, 397, 31, 0x9908B0DFu, 11, 0xFFFFFFFFu, 7,
                                 0x9D2C5680u, 15, 0xEFC60000u, 18, 1812433253u>;

inline constexpr std::array<uint, 3> kGroupSizes = {8, 64, 256};

/// Counts around one and several tiles of n entries: 0, 1, 2, n/2, n - 1, n, n + 1, 4n/3, 3n.
inline std::vector<uint> awkward_counts(uint n) {
  return {0, 1, 2, n / 2, n - 1, n, n + 1, 4 * n / 3, 3 * n};
}

/// The first place where two long vectors differ; they are too long to print.
inline constexpr std::ptrdiff_t kNoDifference = -1;
template <class T>
std::ptrdiff_t first_difference(const std::vector<T> &got, const std::vector<T> &expected) {
  if (got.size() != expected.size())
    return static_cast<std::ptrdiff_t>(std::min(got.size(), expected.size()));
  const auto at = std::mismatch(got.begin(), got.end(), expected.begin()).first;
  return at == got.end() ? kNoDifference : at - got.begin();
}

/// Counts that are all different and unlikely: what no kernel should have touched.
inline PassCounts distinct_counts() {
  PassCounts counts{};
  uint next = 7000001;
#define ISO_SET_FIELD(field) counts.field = next++;
  ISO_PASS_COUNTS_FIELDS(ISO_SET_FIELD)
#undef ISO_SET_FIELD
  return counts;
}

inline void expect_counts(const CountsBuffer &counts, const PassCounts &expected) {
  const PassCounts got = counts.read().front();
#define ISO_COMPARE_FIELD(field) EXPECT_EQ(got.field, expected.field) << "counts." #field;
  ISO_PASS_COUNTS_FIELDS(ISO_COMPARE_FIELD)
#undef ISO_COMPARE_FIELD
}

/// The grid of a volume, without a camera.
inline FrameParams grid_frame(const glm::uvec3 &dims) {
  FrameParams frame{};
  frame.grid.dims_x = dims.x;
  frame.grid.dims_y = dims.y;
  frame.grid.dims_z = dims.z;
  frame.grid.blocks_x = (dims.x + 3) / 4;
  frame.grid.blocks_y = (dims.y + 3) / 4;
  frame.grid.blocks_z = (dims.z + 3) / 4;
  return frame;
}

/// The index of a fixed-accuracy payload that has none.
inline std::vector<std::uint32_t> index_by_decoding(const CompressedVolume &volume) {
  BlockIndexBuilder index;
  find_block_lengths(volume, "a test", [&](const FoundBlocks &found) {
    for (std::uint64_t i = 0; i < found.count; ++i) index.add(found.bits);
  });
  return index.finish();
}

/// Compresses [nz][ny][nx] voxels by one call of libzfp, at any number of bits per block, 9..2048;
/// 0: with the bit planes of min_exponent.
inline CompressedVolume compress_with_libzfp(std::vector<float> voxels, const glm::uvec3 &dims,
                                             std::uint32_t bits_per_block,
                                             std::int32_t min_exponent = ISO_ALL_PLANES) {
  CompressedVolume volume;
  volume.info.dims = dims;
  volume.bits_per_block = bits_per_block;
  volume.precision.min_exponent = min_exponent;
  std::vector<std::uint64_t> words(volume.block_count() * volume.max_block_bits() / 64 + 2);
  const ZfpStream stream = make_zfp_stream(bits_per_block, min_exponent);
  const ZfpBits bits(stream_open(words.data(), words.size() * sizeof(std::uint64_t)),
                     &stream_close);
  const ZfpField field(zfp_field_3d(voxels.data(), zfp_type_float, dims.x, dims.y, dims.z),
                       &zfp_field_free);
  zfp_stream_set_bit_stream(stream.get(), bits.get());
  const std::size_t bytes = zfp_compress(stream.get(), field.get());
  if (bytes == 0) throw std::logic_error("zfp: cannot compress");
  volume.indexed_bits = 8 * bytes;
  volume.words.resize((volume.payload_bits() + 31) / 32 + 2);
  std::memcpy(
      volume.words.data(), words.data(),
      std::min(volume.words.size() * sizeof(std::uint32_t), words.size() * sizeof(std::uint64_t)));
  if (volume.is_indexed()) {
    volume.index = index_by_decoding(volume);
    volume.indexed_bits = volume.block_begin(static_cast<std::uint32_t>(volume.block_count()));
    volume.words.resize((volume.payload_bits() + 31) / 32 + 2);
  }
  return volume;
}

/// The 64 values of every block, padding too: [num_blocks * 64], x + 4y + 16z in a block. By
/// libzfp, which decodes padding when told that the volume is made of whole blocks.
inline std::vector<float> decode_blocks_with_libzfp(CompressedVolume volume) {
  const glm::uvec3 blocks = volume.num_blocks();
  volume.info.dims = 4u * blocks;
  const std::vector<float> voxels = decode_with_libzfp(volume);
  std::vector<float> values(voxels.size());
  std::size_t block_id = 0;
  for (std::size_t z = 0; z < blocks.z; ++z) {
    for (std::size_t y = 0; y < blocks.y; ++y) {
      for (std::size_t x = 0; x < blocks.x; ++x, ++block_id) {
        for (std::size_t v = 0; v < 64; ++v) {
          values[64 * block_id + v] =
              voxels[4 * x + v % 4 +
                     4 * blocks.x * (4 * y + v / 4 % 4 + 4 * blocks.y * (4 * z + v / 16))];
        }
      }
    }
  }
  return values;
}

inline std::vector<float> random_voxels(const glm::uvec3 &dims, float low, float high, uint seed) {
  Random random(seed);
  std::uniform_real_distribution<float> value(low, high);
  std::vector<float> voxels(std::size_t{dims.x} * dims.y * dims.z);
  for (float &voxel : voxels) voxel = value(random);
  return voxels;
}

}  // namespace isowave::core
