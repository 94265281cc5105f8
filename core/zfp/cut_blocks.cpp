#include "core/zfp/cut_blocks.hpp"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <utility>

namespace isowave::core {

BlockCutter::BlockCutter(const CompressedVolume &whole, const BlockBox &box) : whole_(whole) {
  const glm::uvec3 begin = 4u * glm::uvec3(box.begin);
  cut_.info = whole.info;
  cut_.info.dims = glm::min(4u * glm::uvec3(box.end), whole.info.dims) - begin;
  cut_.info.brick.first_voxel = whole.info.brick.first_voxel + begin;
  cut_.bits_per_block = whole.bits_per_block;
  cut_.precision = whole.precision;
  cut_.value_range = whole.value_range;
  cut_.max_voxel_error = whole.max_voxel_error;
  cut_.errors_are_stated = whole.errors_are_stated;
  if (cut_.is_indexed()) {
    index_.reserve(cut_.block_count());
  } else {
    cut_.words.reserve((cut_.payload_bits() + 63) / 64 * 2 + kDecoderAhead);
  }
}

void BlockCutter::add_row(std::uint64_t first_bit, std::span<const std::uint32_t> lengths) {
  const std::uint64_t count = std::accumulate(lengths.begin(), lengths.end(), std::uint64_t{0});
  row_.resize((count + 63) / 64 * 2);
  wide_.resize(row_.size() / 2);
  whole_.read_words(first_bit, row_);
  std::memcpy(wide_.data(), row_.data(), row_.size() * sizeof(std::uint32_t));
  bits_.append(wide_, count);
  take_words();
  if (!cut_.is_indexed()) return;
  for (const std::uint32_t length : lengths) index_.add(length);
  cut_.indexed_bits += count;
}

void BlockCutter::take_words() {
  for (const std::uint64_t word : bits_.words) {
    cut_.words.push_back(static_cast<std::uint32_t>(word));
    cut_.words.push_back(static_cast<std::uint32_t>(word >> 32));
  }
  bits_.words.clear();
}

CompressedVolume BlockCutter::finish() {
  bits_.pad();
  take_words();
  if (cut_.is_indexed()) cut_.index = index_.finish();
  cut_.words.resize((cut_.payload_bits() + 31) / 32 + kDecoderAhead);
  return std::move(cut_);
}

BoundsCutter::BoundsCutter(const glm::uvec3 &blocks, const BlockBox &box)
    : blocks_(blocks), begin_(box.begin), end_(box.end) {}

void BoundsCutter::add(std::span<const std::uint8_t> codes) {
  for (const std::uint8_t code : codes) {
    cut_.largest_of_whole = std::max(cut_.largest_of_whole, code);
    if (glm::all(glm::greaterThanEqual(at_, begin_)) && glm::all(glm::lessThan(at_, end_)))
      cut_.codes.push_back(code);
    if (++at_.x < blocks_.x) continue;
    at_.x = 0;
    if (++at_.y < blocks_.y) continue;
    at_.y = 0;
    ++at_.z;
  }
}

BlockBounds BoundsCutter::finish(const BlockBounds &level) {
  cut_.exponent = level.exponent;
  cut_.by_place = level.by_place;
  return std::move(cut_);
}

CompressedVolume cut_blocks(const CompressedVolume &whole, const BlockBox &box) {
  const glm::u64vec3 blocks(whole.num_blocks());
  const glm::u64vec3 begin(box.begin), end(box.end);
  BlockCutter cutter(whole, box);
  std::vector<std::uint32_t> lengths(end.x - begin.x);
  for (std::uint64_t z = begin.z; z < end.z; ++z) {
    for (std::uint64_t y = begin.y; y < end.y; ++y) {
      const std::uint64_t row = blocks.x * (y + blocks.y * z);
      for (std::uint64_t x = begin.x; x < end.x; ++x)
        lengths[x - begin.x] = whole.block_bits(row + x);
      cutter.add_row(whole.block_begin(row + begin.x), lengths);
    }
  }
  CompressedVolume cut = cutter.finish();
  cut.no_data = cut_no_data(whole.no_data, whole.num_blocks(), box, cut.info.dims);
  if (whole.bounds.codes.empty()) return cut;
  BoundsCutter bounds(whole.num_blocks(), box);
  bounds.add(whole.bounds.codes);
  cut.bounds = bounds.finish(whole.bounds);
  return cut;
}

}  // namespace isowave::core
