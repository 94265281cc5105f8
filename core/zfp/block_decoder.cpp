#include "core/zfp/block_decoder.hpp"

#include "core/zfp/block_chunks.hpp"
#include "kernels_cl/portable/zfp_codec.h"

namespace isowave::core {

void BlockDecoder::load(std::uint64_t first, std::uint64_t count) {
  if (!volume_.file) return;  // in memory, or in chunks
  first_bit_ = volume_.block_begin(first);
  const std::uint64_t num_bits = volume_.block_begin(first + count) - first_bit_;
  const std::uint64_t num_words = (num_bits + 31) / 32;
  read_.assign(num_words + kDecoderAhead, 0);
  volume_.read_words(first_bit_, std::span(read_).first(num_words));
}

void BlockDecoder::decode(std::uint64_t id, std::span<float, ISO_BLOCK_VOXELS> voxels) const {
  const auto decode_bits = [&](const std::uint32_t *words, std::uint64_t bit, std::uint32_t count,
                               std::uint64_t no_data) {
    zfp_decode_any_block(words, bit, count, volume_.precision.min_exponent, voxels.data());
    round_to(whole_numbers_of(volume_.info.type, volume_.precision), voxels);
    clear_no_data(no_data, voxels);
  };
  if (volume_.chunks) {
    const BlockChunks::Block of = volume_.chunks->block(id);
    return decode_bits(of.words, of.first_bit, of.num_bits, of.no_data);
  }
  const std::vector<std::uint32_t> &words = volume_.file ? read_ : volume_.words;
  decode_bits(words.data(), volume_.block_begin(id) - first_bit_, volume_.block_bits(id),
              volume_.no_data.mask(id));
}

}  // namespace isowave::core
