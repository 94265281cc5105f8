#include "core/zfp/block_chunks.hpp"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "core/base/error.hpp"
#include "core/zfp/chunk_layout.hpp"

namespace isowave::core {

namespace {

[[noreturn]] void refuse_chunk() {
  throw Error("the volume's file is damaged, or was replaced: load the page again");
}

}  // namespace

BlockChunks::BlockChunks(Layout layout)
    : layout_(std::move(layout)),
      macrocells_(macrocells_of(layout_.num_blocks)),
      order_(file_order(macrocells_)),
      places_(order_.size()) {
  for (std::size_t place = 0; place < order_.size(); ++place)
    places_[order_[place]] = static_cast<std::uint32_t>(place);
}

BlockChunks::Place BlockChunks::place_of(std::uint64_t block) const {
  const glm::uvec3 &blocks = layout_.num_blocks;
  const auto row = static_cast<std::uint32_t>(block / blocks.x),
             x = static_cast<std::uint32_t>(block % blocks.x);
  const glm::uvec3 at(x, row % blocks.y, row / blocks.y), of = at / kChunkEdge,
                                                          in = at % kChunkEdge;
  const std::uint32_t macrocell = of.x + macrocells_.x * (of.y + macrocells_.y * of.z);
  const glm::uvec3 size = size_of(macrocell);
  return {macrocell, in.x + size.x * (in.y + size.y * in.z)};
}

glm::uvec3 BlockChunks::size_of(std::uint32_t macrocell) const {
  return glm::min(layout_.num_blocks - kChunkEdge * place_in(macrocells_, macrocell),
                  glm::uvec3(kChunkEdge));
}

BlockChunks::Chunk *BlockChunks::find(std::uint32_t macrocell) {
  const auto found = chunks_.find(macrocell);
  if (found == chunks_.end()) {
    const bool is_new = missing_.insert(places_[macrocell]).second;
    if (is_new && new_ones_left_ != 0) --new_ones_left_;
    return nullptr;
  }
  found->second.is_used = true;
  return &found->second;
}

bool BlockChunks::is_there(std::uint64_t block) {
  return find(place_of(block).macrocell) != nullptr;
}

BlockChunks::Block BlockChunks::block(std::uint64_t block) {
  const Place at = place_of(block);
  const Chunk *const chunk = find(at.macrocell);
  if (chunk == nullptr) throw ChunkIsMissing();
  const std::uint32_t first = chunk->first_bits[at.block];
  return {chunk->words.data(), first, chunk->first_bits[at.block + 1] - first,
          chunk->no_data.empty() ? 0 : chunk->no_data[at.block]};
}

void BlockChunks::begin_guesses(std::uint32_t most_new) {
  new_ones_left_ = most_new;
  has_guessed_ = false;
}

void BlockChunks::guess() {
  if (new_ones_left_ == 0) throw ChunkIsMissing();
  has_guessed_ = true;
}

std::vector<FilePart> BlockChunks::take_missing() {
  std::vector<std::uint32_t> places(missing_.begin(), missing_.end());
  missing_.clear();
  std::ranges::sort(places);
  std::vector<FilePart> parts;
  parts.reserve(places.size());
  for (const std::uint32_t place : places)
    parts.push_back({layout_.begins[place], layout_.begins[place + 1]});
  return parts;
}

bool BlockChunks::has_chunk_at(std::uint64_t begin) const {
  const auto at = std::ranges::lower_bound(layout_.begins, begin);
  return at != layout_.begins.end() && *at == begin && begin != layout_.begins.back();
}

void BlockChunks::give(std::uint64_t begin, std::span<const std::byte> bytes) {
  const auto at = std::ranges::lower_bound(layout_.begins, begin);
  if (!has_chunk_at(begin) || at[1] - at[0] != bytes.size()) refuse_chunk();
  const std::uint32_t macrocell = order_[std::size_t(at - layout_.begins.begin())];
  const std::span content = bytes.first(bytes.size() - kChunkCrcBytes);
  std::uint32_t crc = 0;
  std::memcpy(&crc, bytes.data() + content.size(), kChunkCrcBytes);
  if (crc != chunk_crc(layout_.file_id, begin, content)) refuse_chunk();
  const auto [entry, is_new] = chunks_.try_emplace(macrocell);
  if (!is_new) return;
  try {
    entry->second = unpack(macrocell, content);
  } catch (...) {
    chunks_.erase(entry);
    throw;
  }
  bytes_ += bytes.size();
}

BlockChunks::Chunk BlockChunks::unpack(std::uint32_t macrocell,
                                       std::span<const std::byte> bytes) const {
  const glm::uvec3 size = size_of(macrocell);
  const std::uint32_t count = size.x * size.y * size.z;
  const bool is_indexed = layout_.bits_per_block == 0;
  const std::uint64_t head = chunk_head_bytes(count, is_indexed, layout_.has_gaps);
  if (bytes.size() < head) refuse_chunk();
  Chunk chunk;
  chunk.first_bits.assign(1, 0);
  std::vector<std::uint16_t> lengths(is_indexed ? count : 0);
  const std::span length_bytes = bytes.first(lengths.size() * sizeof(std::uint16_t));
  std::ranges::copy(length_bytes, std::as_writable_bytes(std::span(lengths)).begin());
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t length = is_indexed ? lengths[i] : layout_.bits_per_block;
    if (length > std::max(ISO_MAX_BLOCK_BITS, layout_.bits_per_block)) refuse_chunk();
    chunk.first_bits.push_back(chunk.first_bits.back() + length);
  }
  if (layout_.has_gaps) {
    chunk.no_data.resize(count);
    const std::span gaps = bytes.subspan(length_bytes.size(), count * sizeof(std::uint64_t));
    std::ranges::copy(gaps, std::as_writable_bytes(std::span(chunk.no_data)).begin());
  }
  const std::span payload = bytes.subspan(head);
  const std::uint64_t bits = chunk.first_bits.back();
  if (payload.size() != bytes_of_bits(bits)) refuse_chunk();
  chunk.words.resize((bits + 31) / 32 + kDecoderAhead);
  std::ranges::copy(payload, std::as_writable_bytes(std::span(chunk.words)).begin());
  return chunk;
}

void BlockChunks::drop_unused(std::uint64_t most_bytes) {
  for (auto at = chunks_.begin(); at != chunks_.end();) {
    const auto place = places_[at->first];
    if (bytes_ > most_bytes && !at->second.is_used) {
      bytes_ -= layout_.begins[place + 1] - layout_.begins[place];
      at = chunks_.erase(at);
    } else {
      at->second.is_used = false;
      ++at;
    }
  }
}

}  // namespace isowave::core
