#include "core/zfp/chunk_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/byte_source.hpp"
#include "core/volume/pyramid.hpp"
#include "core/zfp/chunk_layout.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_file.hpp"

namespace isowave::core {
using nlohmann::json;

namespace {

void append_bytes(std::vector<std::byte> &bytes, std::span<const std::byte> more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

/// The chunks of a level.
class LevelChunks {
 public:
  explicit LevelChunks(const CompressedVolume &level)
      : level_(level),
        blocks_(level.num_blocks()),
        macrocells_(macrocells_of(blocks_)),
        order_(file_order(macrocells_)) {
    for (const std::uint32_t macrocell : order_) sizes_.push_back(bytes_of(macrocell));
  }

  const std::vector<std::uint32_t> &order() const { return order_; }
  /// [place in the file]
  const std::vector<std::uint32_t> &sizes() const { return sizes_; }

  std::vector<std::byte> table(const MacrocellRanges &ranges) const {
    std::vector<std::uint16_t> halves;
    for (const std::uint32_t macrocell : order_)
      halves.push_back(half_below(ranges.low[macrocell]));
    for (const std::uint32_t macrocell : order_)
      halves.push_back(half_above(ranges.high[macrocell]));
    std::vector<std::byte> packed;
    Deflater deflater([&](std::span<const std::byte> bytes) { append_bytes(packed, bytes); });
    deflater.add(std::as_bytes(std::span(halves)));
    deflater.add(std::as_bytes(std::span(sizes_)));
    deflater.finish();
    return packed;
  }

  /// A chunk but for its checksum.
  std::vector<std::byte> content(std::uint32_t macrocell) const {
    std::vector<std::uint16_t> lengths;
    std::vector<std::uint64_t> no_data, wide;
    std::vector<std::uint32_t> words;
    BitAppender bits;
    std::uint64_t num_bits = 0;
    for_rows(macrocell, [&](std::uint64_t first, std::uint64_t count) {
      for (std::uint64_t block = first; block < first + count; ++block) {
        lengths.push_back(static_cast<std::uint16_t>(level_.block_bits(block)));
        no_data.push_back(level_.no_data.mask(block));
      }
      const std::uint64_t begin = level_.block_begin(first),
                          of_row = level_.block_begin(first + count) - begin;
      words.resize((of_row + 63) / 64 * 2);
      wide.resize(words.size() / 2);
      level_.read_words(begin, words);
      std::ranges::copy(std::as_bytes(std::span(words)),
                        std::as_writable_bytes(std::span(wide)).begin());
      bits.append(wide, of_row);
      num_bits += of_row;
    });
    bits.pad();
    std::vector<std::byte> bytes;
    if (level_.is_indexed()) append_bytes(bytes, std::as_bytes(std::span(lengths)));
    if (!level_.no_data.empty()) append_bytes(bytes, std::as_bytes(std::span(no_data)));
    append_bytes(bytes, std::as_bytes(std::span(bits.words)).first(bytes_of_bits(num_bits)));
    return bytes;
  }

 private:
  /// Calls take(first block, number of blocks) for each row of a macrocell's blocks along x.
  template <class Take>
  void for_rows(std::uint32_t macrocell, const Take &take) const {
    const glm::uvec3 begin = kChunkEdge * place_in(macrocells_, macrocell),
                     end = glm::min(begin + kChunkEdge, blocks_);
    for (std::uint32_t z = begin.z; z < end.z; ++z) {
      for (std::uint32_t y = begin.y; y < end.y; ++y)
        take(begin.x + std::uint64_t{blocks_.x} * (y + std::uint64_t{blocks_.y} * z),
             std::uint64_t{end.x - begin.x});
    }
  }

  std::uint32_t bytes_of(std::uint32_t macrocell) const {
    std::uint64_t bits = 0, num_blocks = 0;
    for_rows(macrocell, [&](std::uint64_t first, std::uint64_t count) {
      bits += level_.block_begin(first + count) - level_.block_begin(first);
      num_blocks += count;
    });
    return static_cast<std::uint32_t>(
        chunk_head_bytes(num_blocks, level_.is_indexed(), !level_.no_data.empty()) +
        bytes_of_bits(bits) + kChunkCrcBytes);
  }

  const CompressedVolume &level_;
  glm::uvec3 blocks_, macrocells_;
  std::vector<std::uint32_t> order_, sizes_;
};

/// What the trailer of the volume's `.zfp` file says of it, and what its header does.
json head_text_of(const CompressedVolume &volume) {
  ZfpLayout layout;
  layout.no_data_bytes = volume.no_data.empty() ? 0 : 1;  // some
  const glm::uvec3 dims = volume.info.dims;
  return {{"dims", {dims.x, dims.y, dims.z}},
          {"volume", zfp_trailer_text(volume, layout)},
          {"levels", json::array()}};
}

json describe_level(const CompressedVolume &level, std::uint64_t table_bytes) {
  return {{"bits_per_block", level.bits_per_block},
          {"min_exponent", level.precision.min_exponent},
          {"payload_bits", level.payload_bits()},
          {"no_data_voxels", level.no_data.num_voxels()},
          {"table_bytes", table_bytes}};
}

}  // namespace

ChunkFileSize write_chunks(std::span<const CompressedVolume *const> levels,
                           std::span<const MacrocellRanges> ranges, AtomicFile &file) {
  json text = head_text_of(*levels.front());
  std::vector<LevelChunks> chunks;
  std::vector<std::byte> tables;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    chunks.emplace_back(*levels[i]);
    const std::vector<std::byte> table = chunks.back().table(ranges[i]);
    append_bytes(tables, table);
    text["levels"].push_back(describe_level(*levels[i], table.size()));
  }
  const std::string json_text = text.dump();
  ChunksHead head{kChunksMagic, kChunksVersion, static_cast<std::uint32_t>(json_text.size()), 0};
  head.crc = update_crc(update_crc(0, std::as_bytes(std::span(json_text))), tables);
  ChunkFileSize size;
  size.bytes = size.head_bytes = sizeof(head) + json_text.size() + tables.size();
  size.id = head.crc;
  file.write(std::as_bytes(std::span(&head, 1)));
  file.write(json_text);
  file.write(tables);
  for (const LevelChunks &level : chunks) {
    for (const std::uint32_t macrocell : level.order()) {
      const std::vector<std::byte> content = level.content(macrocell);
      const std::uint32_t crc = chunk_crc(size.id, size.bytes, content);
      file.write(content);
      file.write(std::as_bytes(std::span(&crc, 1)));
      size.bytes += content.size() + kChunkCrcBytes;
    }
  }
  return size;
}

namespace {

[[noreturn]] void refuse_head() {
  throw Error("the volume's file is damaged, or none that isowave wrote");
}

std::vector<std::byte> unpacked(std::span<const std::byte> packed, std::uint64_t num_bytes) {
  if (num_bytes / kMaxDeflateRatio > packed.size()) refuse_head();
  std::vector<std::byte> bytes(num_bytes);
  auto length = static_cast<uLongf>(num_bytes);
  const int result = ::uncompress(reinterpret_cast<Bytef *>(bytes.data()), &length,
                                  reinterpret_cast<const Bytef *>(packed.data()),
                                  static_cast<uLong>(packed.size()));
  if (result != Z_OK || length != num_bytes) refuse_head();
  return bytes;
}

template <class T>
std::span<const std::byte> take_items(std::span<const std::byte> bytes, std::vector<T> &items) {
  const std::span into = std::as_writable_bytes(std::span(items));
  std::ranges::copy(bytes.first(into.size()), into.begin());
  return bytes.subspan(into.size());
}

/// Gives a level its chunks.
///
/// begin    of the level's first chunk in the file
/// Returns  the end of its last
std::uint64_t add_chunks(CompressedVolume &level, std::span<const std::byte> table,
                         std::uint32_t file_id, std::uint64_t begin) {
  const std::vector<std::uint32_t> order = file_order(macrocells_of(level.num_blocks()));
  const std::vector<std::byte> bytes = unpacked(table, kChunkRowBytes * order.size());
  std::vector<std::uint16_t> low(order.size()), high(order.size());
  std::vector<std::uint32_t> sizes(order.size());
  take_items(take_items(take_items(bytes, low), high), sizes);
  BlockChunks::Layout layout{
      level.num_blocks(), level.bits_per_block, !level.no_data.empty(), file_id, {begin}, {}};
  layout.ranges.low.resize(order.size());
  layout.ranges.high.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (sizes[i] < kChunkCrcBytes) refuse_head();
    layout.begins.push_back(layout.begins.back() + sizes[i]);
    layout.ranges.low[order[i]] = from_half(low[i]);
    layout.ranges.high[order[i]] = from_half(high[i]);
  }
  const std::uint64_t end = layout.begins.back();
  level.chunks = std::make_shared<BlockChunks>(std::move(layout));
  return end;
}

/// What a level's blocks are like.
void apply_level(const json &text, CompressedVolume &level) {
  level.bits_per_block = text.at("bits_per_block").get<std::uint32_t>();
  if (level.bits_per_block > ISO_MAX_BLOCK_BITS) refuse_head();
  level.precision.min_exponent = text.at("min_exponent").get<std::int32_t>();
  level.indexed_bits = text.at("payload_bits").get<std::uint64_t>();
  level.no_data = NoData(text.at("no_data_voxels").get<std::uint64_t>());
  level.errors_are_stated = true;
}

CompressedVolume read_levels(const json &text, std::span<const std::byte> tables,
                             std::uint32_t file_id, std::uint64_t head_bytes,
                             std::uint64_t num_bytes) {
  std::vector<CompressedVolume> levels;
  std::uint64_t begin = head_bytes;
  for (const json &of_level : text.at("levels")) {
    CompressedVolume level;
    if (levels.empty()) {
      const json &dims = text.at("dims");
      for (int axis = 0; axis < 3; ++axis)
        level.info.dims[axis] = dims.at(std::size_t(axis)).get<std::uint32_t>();
    } else {
      level.info = coarser_level(levels.back().info);
    }
    check_volume_info(level.info, "the volume's file");
    apply_level(of_level, level);
    if (levels.empty()) apply_zfp_trailer(text.at("volume").get<std::string>(), level);
    check_volume_info(level.info, "the volume's file");
    const auto table_bytes = of_level.at("table_bytes").get<std::uint64_t>();
    if (table_bytes > tables.size() || levels.size() == kMaxLevels) refuse_head();
    begin = add_chunks(level, tables.first(table_bytes), file_id, begin);
    tables = tables.subspan(table_bytes);
    levels.push_back(std::move(level));
  }
  if (levels.empty() || !tables.empty() || begin != num_bytes) refuse_head();
  CompressedVolume volume = std::move(levels.front());
  volume.coarser_levels.assign(std::move_iterator(levels.begin() + 1),
                               std::move_iterator(levels.end()));
  return volume;
}

}  // namespace

CompressedVolume read_chunks_head(std::span<const std::byte> head, std::uint64_t num_bytes) {
  ChunksHead first{};
  if (head.size() < sizeof(first)) refuse_head();
  std::memcpy(&first, head.data(), sizeof(first));
  const std::span rest = head.subspan(sizeof(first));
  if (first.magic != kChunksMagic || first.version != kChunksVersion ||
      first.json_bytes > rest.size() || update_crc(0, rest) != first.crc)
    refuse_head();
  const std::span text = rest.first(first.json_bytes);
  try {
    return read_levels(json::parse(reinterpret_cast<const char *>(text.data()),
                                   reinterpret_cast<const char *>(text.data()) + text.size()),
                       rest.subspan(first.json_bytes), first.crc, head.size(), num_bytes);
  } catch (const json::exception &) {
    refuse_head();
  }
}

}  // namespace isowave::core
