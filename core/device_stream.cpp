#include "core/device_stream.hpp"

#include <algorithm>
#include <numeric>

#include "core/error.hpp"
#include "core/io/mapped_file.hpp"

namespace isowave {

namespace {

constexpr std::uint64_t kAhead = 2;  ///< words that a decoder reads past its block at most

/// Uploads the volume's words from word `first` on.
void write_words(const CompressedVolume &volume, std::uint64_t first, ocl::Buffer<uint> &part) {
  if (!volume.file) return part.write(std::span(volume.words).subspan(first, part.size()));
  constexpr std::size_t kChunkWords = 1u << 22;
  std::vector<uint> chunk(std::min(kChunkWords, part.size()));
  for (std::size_t done = 0; done < part.size(); done += chunk.size()) {
    chunk.resize(std::min(chunk.size(), part.size() - done));
    volume.file->check();
    volume.read_words(32 * (first + done), chunk);
    part.write(chunk, done);
  }
}

}  // namespace

StreamSplit split_stream(const CompressedVolume &volume, std::uint64_t largest_part) {
  const std::uint64_t blocks = volume.block_count(), bits = volume.bits_per_block;
  const std::uint64_t largest_words = largest_part / sizeof(uint);
  if (volume.word_count() <= largest_words) {
    return {1, static_cast<std::uint32_t>(blocks), {volume.word_count()}};
  }
  // So many blocks are whole words.
  const std::uint64_t unit = 32 / std::gcd<std::uint64_t>(32, bits);
  const std::uint64_t per_part =
      largest_words < kAhead ? 0 : (largest_words - kAhead) * 32 / bits / unit * unit;
  if (per_part == 0 || (blocks + per_part - 1) / per_part > kMaxStreamParts) return {};
  StreamSplit split;
  split.blocks_per_part = static_cast<std::uint32_t>(per_part);
  for (std::uint64_t first = 0; first < blocks; first += per_part, ++split.num_parts) {
    split.words.push_back((std::min(per_part, blocks - first) * bits + 31) / 32 + kAhead);
  }
  return split;
}

DeviceStream::DeviceStream(ocl::Device &device, const CompressedVolume &volume, std::uint64_t largest_part)
    : bits_per_block(volume.bits_per_block) {
  const std::uint64_t largest = largest_part != 0 ? largest_part : device.capabilities().largest_allocation;
  const StreamSplit split = split_stream(volume, largest);
  if (split.num_parts == 0) {
    throw Error("the compressed volume of {} bytes does not fit {} buffers of {} bytes on device '{}'",
                volume.word_count() * sizeof(uint), kMaxStreamParts, largest, device.info().name);
  }
  blocks_per_part = split.blocks_per_part;
  std::uint64_t first_bit = 0;
  for (const std::uint64_t words : split.words) {
    parts.emplace_back(device, "zfp stream", words);
    write_words(volume, first_bit / 32, parts.back());
    first_bit += std::uint64_t{blocks_per_part} * bits_per_block;
  }
}

DeviceStream::DeviceStream(ocl::Device &device, const CompressedVolume &volume, OnHost host)
    : window(std::make_unique<StreamWindow>(device, volume, host.window_blocks)),
      bits_per_block(volume.bits_per_block) {}

ocl::Defines DeviceStream::defines() const {
  if (parts.size() == 1) return {};  // as kernels are built without a word
  return {{"ISO_STREAM_PARTS", std::to_string(parts.size())}};
}

}  // namespace isowave
