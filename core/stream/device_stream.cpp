#include "core/stream/device_stream.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/base/error.hpp"
#include "kernels_cl/portable/label_table.h"

namespace isowave::core {

namespace {

StreamLayout layout_of(const CompressedVolume &volume, std::uint32_t words_per_part) {
  const WholeNumbers whole = whole_numbers_of(volume.info.type, volume.precision);
  return {volume.bits_per_block,
          words_per_part,
          volume.precision.min_exponent,
          whole.least,
          whole.greatest,
          0.0f,
          0.0f,
          0,
          volume.bounds.by_place ? 1u : 0u,
          ISO_INVALID_ID};
}

/// Throws  Error: the device drops bits of values as small as the volume's
void check_denormals(const ocl::Device &device, const CompressedVolume &volume) {
  const float largest = std::max(std::abs(volume.value_range[0]), std::abs(volume.value_range[1]));
  if (device.capabilities().denormals || largest == 0 || largest >= kMinMagnitude) return;
  throw Error("device '{}' has no denormal numbers, as values of at most {} need: scale them up",
              device.info().name, largest);
}

/// Uploads the volume's words from word `first` on.
void write_words(const CompressedVolume &volume, std::uint64_t first, ocl::Buffer<uint> &part) {
  if (!volume.file) return part.write(std::span(volume.words).subspan(first, part.size()));
  constexpr std::size_t kChunkWords = 1u << 22;
  std::vector<uint> chunk(std::min(kChunkWords, part.size()));
  for (std::size_t done = 0; done < part.size(); done += chunk.size()) {
    chunk.resize(std::min(chunk.size(), part.size() - done));
    volume.read_words(32 * (first + done), chunk);
    part.write(chunk, done);
  }
}

/// The buffer of the places of blocks, if they have lengths of their own, then the table of bytes,
/// then that of voxels without data; no buffer if there is none of them.
ocl::BufferSizes index_sizes(std::span<const std::uint32_t> index,
                             std::span<const std::uint8_t> bytes,
                             std::span<const std::uint32_t> no_data) {
  const std::uint64_t words = index.size() + (bytes.size() + 3) / 4 + no_data.size();
  if (words == 0) return {};
  return {ocl::buffer_size<uint>("block index", words)};
}

std::span<const std::uint32_t> index_of(const CompressedVolume &volume) {
  if (!volume.is_indexed()) return {};
  return volume.index;
}

std::span<const std::uint8_t> bytes_of(const CompressedVolume &volume, ByteTable bytes) {
  static constexpr std::array<std::uint8_t, ISO_NUM_LABELS> kInNoGroup{};
  if (bytes == ByteTable::kNone) return {};
  return bytes == ByteTable::kBounds ? std::span<const std::uint8_t>(volume.bounds.codes)
                                     : kInNoGroup;
}

/// Four bytes a word, the first in bits 0..7.
std::vector<std::uint32_t> packed(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint32_t> words((bytes.size() + 3) / 4);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    words[i / 4] |= std::uint32_t{bytes[i]} << 8 * (i % 4);
  return words;
}

}  // namespace

StreamSplit split_stream(const CompressedVolume &volume, std::uint64_t largest_part) {
  const std::uint64_t largest_words = largest_part / sizeof(uint), all = volume.word_count();
  if (all <= largest_words) return {1, 0, {all}};
  // A block may begin with the last bit of a part.
  const std::uint64_t beyond = (volume.max_block_bits() + 30) / 32 + kDecoderAhead;
  const std::uint64_t begins = all - kDecoderAhead;  // blocks begin in that many words
  const std::uint64_t per_part = std::min<std::uint64_t>(
      largest_words - std::min(largest_words, beyond), std::numeric_limits<std::uint32_t>::max());
  if (per_part == 0 || (begins + per_part - 1) / per_part > kMaxStreamParts) return {};
  StreamSplit split;
  split.words_per_part = static_cast<std::uint32_t>(per_part);
  for (std::uint64_t first = 0; first < begins; first += per_part, ++split.num_parts) {
    split.words.push_back(std::min(per_part + beyond, all - first));
  }
  return split;
}

ocl::BufferSizes DeviceStream::sizes(const CompressedVolume &volume, const StreamSplit &split,
                                     ByteTable bytes) {
  ocl::BufferSizes sizes;
  for (const std::uint64_t words : split.words)
    sizes.add({ocl::buffer_size<uint>("zfp stream", words)});
  return sizes.add(index_sizes(index_of(volume), bytes_of(volume, bytes), volume.no_data.table()));
}

/// A window brings the places of its blocks itself.
ocl::BufferSizes DeviceStream::sizes(const CompressedVolume &volume, OnHost host, ByteTable bytes) {
  return StreamWindow::sizes(volume, host.window_blocks)
      .add(index_sizes({}, bytes_of(volume, bytes), volume.no_data.table()));
}

DeviceStream::DeviceStream(ocl::Device &device, const CompressedVolume &volume,
                           std::uint64_t largest_part, ByteTable bytes)
    : indexed_(volume.is_indexed()), bytes_(bytes) {
  check_denormals(device, volume);
  const std::uint64_t largest =
      largest_part != 0 ? largest_part : device.capabilities().largest_allocation;
  const StreamSplit split = split_stream(volume, largest);
  if (split.num_parts == 0) {
    throw Error(
        "the compressed volume of {} bytes does not fit {} buffers of {} bytes on device '{}'",
        volume.word_count() * sizeof(uint), kMaxStreamParts, largest, device.info().name);
  }
  layout = layout_of(volume, split.words_per_part);
  std::uint64_t first = 0;
  for (const ocl::BufferSize &size : sizes(volume, split, bytes).named("zfp stream")) {
    parts.emplace_back(device, size);
    write_words(volume, first, parts.back());
    first += split.words_per_part;
  }
  add_index(device, index_of(volume), bytes_of(volume, bytes), volume.no_data.table());
}

DeviceStream::DeviceStream(ocl::Device &device, const CompressedVolume &volume, OnHost host,
                           ByteTable bytes)
    : window(std::make_unique<StreamWindow>(device, volume, host.window_blocks, host.max_copy)),
      layout(layout_of(volume, 0)),
      indexed_(volume.is_indexed()),
      bytes_(bytes) {
  check_denormals(device, volume);
  add_index(device, {}, bytes_of(volume, bytes), volume.no_data.table());
}

void DeviceStream::add_index(ocl::Device &device, std::span<const std::uint32_t> index,
                             std::span<const std::uint8_t> bytes,
                             std::span<const std::uint32_t> no_data) {
  layout.bounds_begin = static_cast<std::uint32_t>(index.size());
  const ocl::BufferSizes sizes = index_sizes(index, bytes, no_data);
  if (sizes.size() == 0) return;
  block_index.emplace(device, sizes["block index"]);
  std::vector<std::uint32_t> all;
  if (!bytes.empty() || !no_data.empty()) {
    const std::vector<std::uint32_t> words = packed(bytes);
    all.assign(index.begin(), index.end());
    all.insert(all.end(), words.begin(), words.end());
    all.insert(all.end(), no_data.begin(), no_data.end());
    index = all;
  }
  if (!no_data.empty()) {
    layout.no_data_begin = static_cast<std::uint32_t>(all.size() - no_data.size());
    device.draw_no_data();
  }
  block_index->write(index);
}

void DeviceStream::set_groups(std::span<const std::uint8_t> table) {
  const std::vector<std::uint32_t> words = packed(table);
  if (block_index->device().info().platform != "Oclgrind")
    return block_index->write(words, layout.bounds_begin);
  // Oclgrind takes what was written in parts for uninitialised.
  std::vector<std::uint32_t> all = block_index->read();
  std::ranges::copy(words, all.begin() + layout.bounds_begin);
  block_index->write(all);
}

ocl::Defines DeviceStream::defines() const {
  ocl::Defines defines;  // none: as kernels are built without a word
  if (parts.size() != 1) defines.emplace("ISO_STREAM_PARTS", parts.empty() ? "0" : "4");
  if (indexed_) defines.emplace("ISO_STREAM_INDEXED", "1");
  if (has_groups()) defines.emplace("ISO_LABELS", "1");
  if (layout.min_exponent == ISO_REVERSIBLE) defines.emplace("ISO_STREAM_REVERSIBLE", "1");
  return defines;
}

bool DeviceStream::is_window(const ocl::Defines &defines) {
  const auto parts = defines.find("ISO_STREAM_PARTS");
  return parts != defines.end() && parts->second == "0";
}

}  // namespace isowave::core
