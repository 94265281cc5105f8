// Compressed volumes. Input: the file. If a file is accepted, our decoder and libzfp decode each
// block to the same bits, the file reads the same after it is written again, and its stated errors
// are checked. Mutations change what checksums and compression guard (zfp_parts.hpp).

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <span>
#include <vector>

#include "core/zfp/stated_errors.hpp"
#include "core/zfp/zfp_file.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/zfp_codec.h"
#include "tests/fuzz/fuzz_target.hpp"
#include "tests/fuzz/zfp_parts.hpp"

using namespace isowave::core;

namespace {

/// Applies a mutation to one thing in the file, or in one of its levels.
void mutate_part(fuzz::ZfpParts &parts, std::size_t max_size, std::minstd_rand &random) {
  if (!parts.levels.empty() && random() % 3 == 0)
    return mutate_part(parts.levels[random() % parts.levels.size()], max_size, random);
  const auto dice = random() % 32;
  if (dice < 14) {
    fuzz::mutate(parts.text, max_size);
  } else if (dice < 21) {
    fuzz::mutate(parts.stream, max_size);
  } else if (dice < 25) {
    fuzz::mutate(parts.index, max_size);
  } else if (dice < 28) {
    fuzz::mutate(parts.bounds, max_size);
  } else if (dice < 30 && !parts.levels.empty()) {
    parts.levels.push_back(parts.levels[random() % parts.levels.size()]);
  } else if (dice < 31 && !parts.levels.empty()) {
    parts.levels.pop_back();
  } else {
    parts.version = std::uint32_t(random() % 6);
  }
}

/// What stands in the cache for a block, in the order of its voxels.
std::array<float, 64> decode(const CompressedVolume &volume, std::uint32_t block) {
  const std::uint32_t bits = volume.block_bits(block);
  std::vector<std::uint32_t> words((bits + 31) / 32 + kDecoderAhead);
  volume.read_words(volume.block_begin(block), words);
  std::array<float, 64> values{};
  zfp_decode_any_block(words.data(), 0, bits, volume.precision.min_exponent, values.data());
  if (volume.precision.whole_numbers)
    std::ranges::transform(values, values.begin(), [](float v) { return std::rint(v) + 0.0f; });
  return values;
}

void demand_libzfp_agrees(const CompressedVolume &volume) {
  const glm::uvec3 dims = volume.info.dims, blocks = volume.num_blocks();
  const std::vector<float> voxels = decode_with_libzfp(volume);
  for (std::uint32_t id = 0; id < volume.block_count(); ++id) {
    const glm::uvec3 at =
        4u * glm::uvec3(id % blocks.x, id / blocks.x % blocks.y, id / blocks.x / blocks.y);
    const glm::uvec3 size = glm::min(dims - at, glm::uvec3(4));
    const std::array<float, 64> values = decode(volume, id);
    for (std::uint32_t z = 0; z < size.z; ++z) {
      for (std::uint32_t y = 0; y < size.y; ++y) {
        const std::size_t row =
            at.x + std::size_t(dims.x) * (at.y + y + std::size_t(dims.y) * (at.z + z));
        fuzz::demand(fuzz::same_bits(std::span(voxels).subspan(row, size.x),
                                     std::span(values).subspan(4 * y + 16 * z, size.x)),
                     "libzfp decodes a block to other values");
      }
    }
  }
}

/// What a file says, but for its payload.
bool same_head(const CompressedVolume &a, const CompressedVolume &b) {
  return a.info.dims == b.info.dims && a.info.spacing == b.info.spacing &&
         a.info.origin == b.info.origin && a.info.direction == b.info.direction &&
         a.info.type == b.info.type && a.bits_per_block == b.bits_per_block &&
         a.precision.min_exponent == b.precision.min_exponent &&
         a.max_voxel_error == b.max_voxel_error &&
         a.precision.whole_numbers == b.precision.whole_numbers &&
         a.coarser_levels.size() == b.coarser_levels.size();
}

void demand_same(const CompressedVolume &a, const CompressedVolume &b) {
  fuzz::demand(same_head(a, b) && a.index == b.index && a.words == b.words &&
                   a.bounds.codes == b.bounds.codes &&
                   (a.bounds.codes.empty() || a.bounds.exponent == b.bounds.exponent),
               "a volume is not the one that was written");
  for (std::size_t level = 0; level < a.coarser_levels.size(); ++level)
    demand_same(a.coarser_levels[level], b.coarser_levels[level]);
}

void demand_written_again(const CompressedVolume &volume, const std::filesystem::path &path) {
  ZfpFileWriter writer(path, volume);
  const auto write = [&](const CompressedVolume &at, std::size_t level) {
    std::vector<std::uint32_t> words((at.payload_bits() + 31) / 32);
    at.read_words(0, words);
    writer.write(std::as_bytes(std::span(words)), level);
  };
  write(volume, 0);
  for (std::size_t level = 0; level < volume.coarser_levels.size(); ++level)
    write(volume.coarser_levels[level], level + 1);
  writer.commit(volume);
  demand_same(read_zfp_file(path), volume);
}

}  // namespace

std::size_t LLVMFuzzerCustomMutator(std::uint8_t *data, std::size_t size, std::size_t max_size,
                                    unsigned seed) {
  std::minstd_rand random(seed);
  std::optional<fuzz::ZfpParts> parts = fuzz::take_apart(fuzz::text_of(data, size));
  if (!parts || random() % 16 == 0) return LLVMFuzzerMutate(data, size, max_size);
  mutate_part(*parts, max_size, random);
  return fuzz::replace(fuzz::put_together(*parts, random() % 8 != 0), data, size, max_size);
}

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  const std::filesystem::path path = fuzz::put("volume.zfp", fuzz::text_of(data, size));
  fuzz::accepts([&] { read_zfp_file_info(path); });
  CompressedVolume volume, in_file;
  const bool accepted = fuzz::accepts([&] { volume = read_zfp_file(path); });
  fuzz::demand(accepted == fuzz::accepts([&] { in_file = open_zfp_file(path); }),
               "one way to read a file refuses it, another does not");
  if (!accepted) return 0;
  fuzz::demand(same_head(read_zfp_file_info(path), volume) && same_head(in_file, volume) &&
                   same_head(check_zfp_file(path), volume),
               "two ways to read a file differ");
  demand_libzfp_agrees(in_file);
  for (const CompressedVolume &level : in_file.coarser_levels) demand_libzfp_agrees(level);
  fuzz::accepts([&] { check_stated_errors(in_file, {}); });
  // At a fixed rate, only blocks of whole 64-bit words are written.
  if (volume.bits_per_block % 64 == 0) demand_written_again(volume, path);
  return 0;
}
