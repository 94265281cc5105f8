#include "core/zfp/zfp_stream.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/base/error.hpp"
#include "core/io/input_file.hpp"
#include "core/volume/pyramid.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/pyramid_coder.hpp"
#include "core/zfp/zfp_file.hpp"
#include "kernels_cl/portable/whole_number.h"

namespace isowave::core {

namespace {

/// The volume and its coarser levels.
std::vector<CompressedVolume *> all_levels(CompressedVolume &volume) {
  std::vector<CompressedVolume *> levels = {&volume};
  for (CompressedVolume &level : volume.coarser_levels) levels.push_back(&level);
  return levels;
}

/// Hands the payload of each level to its sink, in order, and completes `volume`.
void run(VolumeReader &reader, const CompressOptions &options, std::span<const PayloadSink> sinks,
         CompressedVolume &volume) {
  PyramidCoder coder(options, all_levels(volume), sinks, true, !volume.coarser_levels.empty());
  std::optional<std::array<float, 2>> made;
  if (DeviceVoxels *voxels = reader.on_device(); voxels != nullptr && !options.input.no_data)
    made = coder.code_made(*voxels);
  volume.value_range = made ? *made : read_in_chunks(reader, input_of(options), coder).coded;
  coder.finish();
}

}  // namespace

std::uint64_t CompressedVolume::payload_bits() const {
  return is_indexed() ? indexed_bits : block_count() * bits_per_block;
}

std::uint64_t CompressedVolume::block_begin(std::uint64_t block_id) const {
  // Blocks of lengths of their own are fewer than 2^32.
  return is_indexed()
             ? isowave::core::block_begin(index.data(), static_cast<std::uint32_t>(block_id))
             : block_id * bits_per_block;
}

std::uint32_t CompressedVolume::block_bits(std::uint64_t block_id) const {
  if (!is_indexed()) return bits_per_block;
  return static_cast<std::uint32_t>(block_begin(block_id + 1) - block_begin(block_id));
}

std::uint64_t CompressedVolume::word_count() const {
  return words.empty() ? (payload_bits() + 31) / 32 + 2 : words.size();
}

void CompressedVolume::read_words(std::uint64_t bit, std::span<std::uint32_t> out) const {
  const std::uint64_t end = payload_bits(), left = bit < end ? end - bit : 0;
  const std::uint64_t count = std::min(32 * std::uint64_t{out.size()}, left);
  if (!file) return copy_bits(std::as_bytes(std::span(words)), bit, count, out);
  const std::uint64_t first = file_first_bit + bit, num_bytes = (first % 8 + count + 7) / 8;
  std::array<std::byte, ISO_MAX_BLOCK_BITS / 8 + 2> of_block{};
  std::vector<std::byte> of_many(num_bytes > of_block.size() ? num_bytes : 0);
  const std::span<std::byte> bytes =
      std::span(of_many.empty() ? std::span<std::byte>(of_block) : std::span(of_many))
          .first(num_bytes);
  file->read(first / 8, bytes);
  copy_bits(bytes, first % 8, count, out);
}

void copy_bits(std::span<const std::byte> bytes, std::uint64_t bit, std::uint64_t count,
               std::span<std::uint32_t> out) {
  const std::uint64_t num_words = count / 32, left = count % 32, shift = bit % 8;
  const std::byte *source = bytes.data() + bit / 8;
  if (shift == 0) {
    std::memcpy(out.data(), source, num_words * sizeof(std::uint32_t));
  } else {
    for (std::uint64_t i = 0; i < num_words; ++i) {  // of every word, the fifth byte holds bits too
      std::uint64_t five = 0;
      std::memcpy(&five, source + i * sizeof(std::uint32_t), 5);
      out[i] = std::uint32_t(five >> shift);
    }
  }
  if (num_words == out.size()) return;
  std::uint64_t last = 0;
  if (left != 0) {
    std::memcpy(&last, source + num_words * sizeof(std::uint32_t), (shift + left + 7) / 8);
    last = last >> shift & ((1ull << left) - 1);
  }
  out[num_words] = std::uint32_t(last);
  std::ranges::fill(out.subspan(num_words + 1), 0u);
}

void set_spacing(CompressedVolume &volume, const glm::dvec3 &spacing) {
  volume.info.spacing = spacing;
  glm::dvec3 of_level = spacing;
  for (CompressedVolume &level : volume.coarser_levels) level.info.spacing = of_level *= 2.0;
}

CompressedVolume compress(VolumeReader &reader, const CompressOptions &options) {
  CompressedVolume volume = describe_compressed(reader.info(), options);
  std::vector<PayloadSink> sinks;
  for (CompressedVolume *level : all_levels(volume)) {
    level->words.reserve(level->is_indexed() ? 0 : level->word_count());
    sinks.emplace_back([&words = level->words](std::span<const std::byte> payload) {
      const std::size_t begin = words.size();
      words.resize(begin + payload.size() / sizeof(std::uint32_t));
      std::ranges::copy(payload, std::as_writable_bytes(std::span(words).subspan(begin)).begin());
    });
  }
  run(reader, options, sinks, volume);
  for (CompressedVolume *level : all_levels(volume))
    level->words.resize((level->payload_bits() + 31) / 32 + kDecoderAhead);
  return volume;
}

CompressedVolume compress_to_file(VolumeReader &reader, const CompressOptions &options,
                                  const std::filesystem::path &path) {
  CompressedVolume volume = describe_compressed(reader.info(), options);
  ZfpFileWriter file(path, volume);
  std::vector<PayloadSink> sinks;
  for (std::size_t level = 0; level <= volume.coarser_levels.size(); ++level)
    sinks.emplace_back(
        [&file, level](std::span<const std::byte> payload) { file.write(payload, level); });
  run(reader, options, sinks, volume);
  file.commit(volume);
  return volume;
}

BlockPrecision with_fewer_planes(const BlockPrecision &bound, double voxel_error) {
  if (!(voxel_error >= 0) || !std::isfinite(voxel_error))
    throw Error("a voxel error of {} cannot be allowed: give 0 or more", voxel_error);
  const std::int32_t min_exponent = voxel_error > 0 ? std::ilogb(voxel_error) : ISO_ALL_PLANES;
  if (min_exponent <= bound.min_exponent || bound.is_reversible()) return bound;
  if (bound.whole_numbers && min_exponent < 0) return bound;
  return {min_exponent, bound.whole_numbers, {}};
}

WholeNumbers whole_numbers_of(VoxelType type, const BlockPrecision &precision) {
  if (!precision.whole_numbers) return {};
  return with_voxel_type(type, [](auto of_type) {
    using Limits = std::numeric_limits<decltype(of_type)>;
    return WholeNumbers{static_cast<float>(Limits::lowest()), static_cast<float>(Limits::max())};
  });
}

void round_to(const WholeNumbers &whole, std::span<float> values) {
  if (whole.least > whole.greatest) return;
  for (float &value : values) value = whole_number(value, whole.least, whole.greatest);
}

namespace {

/// Bits before the bit planes of the block that begins with bit `begin`. A block with fewer bits is
/// zeros.
std::uint32_t head_bits(const CompressedVolume &volume, std::span<const std::uint32_t> words,
                        std::uint64_t begin) {
  if (!volume.precision.is_reversible()) return 9;
  std::array<std::uint32_t, 1> kind{};
  copy_bits(std::as_bytes(words), begin, 2, kind);
  return kind[0] == 1 ? 15 : 7;
}

}  // namespace

std::vector<float> decode_with_libzfp(const CompressedVolume &volume, double voxel_error) {
  // libzfp reads whole 64-bit words: four of 32 bits more keep its last read inside.
  std::vector<std::uint32_t> words(volume.word_count() + 4);
  volume.read_words(0, words);
  const glm::uvec3 dims = volume.info.dims, blocks = volume.num_blocks();
  const BlockPrecision bound = with_fewer_planes(volume.precision, voxel_error);
  const ZfpStream stream = make_zfp_stream(volume.bits_per_block, bound.min_exponent);
  const ZfpBits bits(or_bad_alloc(stream_open(words.data(), words.size() * sizeof(std::uint32_t))),
                     &stream_close);
  zfp_stream_set_bit_stream(stream.get(), bits.get());
  std::vector<float> voxels(volume.info.num_voxels());
  float *voxel = voxels.data();
  for (std::uint32_t id = 0; id < volume.block_count(); ++id) {
    const glm::uvec3 at =
        4u * glm::uvec3(id % blocks.x, id / blocks.x % blocks.y, id / blocks.x / blocks.y);
    const glm::uvec3 size = glm::min(dims - at, glm::uvec3(4));
    stream_rseek(bits.get(),
                 volume.block_begin(id));  // a block may have more bits than are decoded
    const std::uint32_t length = volume.block_bits(id);
    if (length < head_bits(volume, words, volume.block_begin(id))) continue;
    // A lying index may end a block before its bits do.
    if (volume.is_indexed())
      zfp_stream_set_params(stream.get(), ZFP_MIN_BITS, length, ZFP_MAX_PREC, bound.min_exponent);
    const auto layer = std::ptrdiff_t(dims.x) * dims.y;
    zfp_decode_partial_block_strided_float_3(
        stream.get(), voxel + at.x + std::ptrdiff_t(dims.x) * at.y + layer * at.z, size.x, size.y,
        size.z, 1, dims.x, layer);
  }
  round_to(whole_numbers_of(volume.info.type, bound), voxels);
  for (std::uint64_t id = 0; !volume.no_data.empty() && id < volume.block_count(); ++id) {
    const glm::uvec3 at =
        4u * glm::uvec3(id % blocks.x, id / blocks.x % blocks.y, id / blocks.x / blocks.y);
    for (std::uint64_t left = volume.no_data.mask(id) & voxels_of_block(dims, id); left != 0;
         left &= left - 1) {
      const auto bit = static_cast<std::uint32_t>(std::countr_zero(left));
      const glm::u64vec3 place = at + glm::uvec3(bit & 3, bit >> 2 & 3, bit >> 4);
      voxels[place.x + dims.x * (place.y + dims.y * place.z)] =
          std::numeric_limits<float>::quiet_NaN();
    }
  }
  return voxels;
}

}  // namespace isowave::core
