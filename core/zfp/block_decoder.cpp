#include "core/zfp/block_decoder.hpp"

#include "kernels_cl/portable/zfp_codec.h"

namespace isowave::core {

void BlockDecoder::load(std::uint64_t first, std::uint64_t count) {
  if (!volume_.file) return;
  first_bit_ = volume_.block_begin(first);
  const std::uint64_t num_bits = volume_.block_begin(first + count) - first_bit_;
  const std::uint64_t num_words = (num_bits + 31) / 32;
  read_.assign(num_words + kDecoderAhead, 0);
  volume_.read_words(first_bit_, std::span(read_).first(num_words));
}

void BlockDecoder::decode(std::uint64_t id, std::span<float, ISO_BLOCK_VOXELS> voxels) const {
  const std::vector<std::uint32_t> &words = volume_.file ? read_ : volume_.words;
  zfp_decode_any_block(words.data(), volume_.block_begin(id) - first_bit_, volume_.block_bits(id),
                       volume_.precision.min_exponent, voxels.data());
  round_to(whole_numbers_of(volume_.info.type, volume_.precision), voxels);
  clear_no_data(volume_.no_data.mask(id), voxels);
}

}  // namespace isowave::core
