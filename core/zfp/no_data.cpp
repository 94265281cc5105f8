#include "core/zfp/no_data.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

namespace {

std::uint64_t num_groups(std::uint64_t num_blocks) {
  return (num_blocks + ISO_NO_DATA_BLOCKS - 1) / ISO_NO_DATA_BLOCKS;
}

}  // namespace

std::uint64_t no_data_masks_begin(std::uint64_t num_blocks) {
  return (ISO_NO_DATA_WORDS * num_groups(num_blocks) + 1) / 2 * 2;
}

std::uint64_t voxels_of_block(const glm::uvec3 &dims, std::uint64_t block) {
  const glm::u64vec3 blocks((dims + 3u) / 4u);
  const glm::ivec3 left =
      glm::ivec3(dims) -
      4 * glm::ivec3(block % blocks.x, block / blocks.x % blocks.y, block / blocks.x / blocks.y);
  return first_voxels(left.x, left.y, left.z);
}

void NoDataBuilder::add(std::uint64_t mask) {
  const std::uint64_t block = count_++;
  if (mask == 0) return;
  const std::uint64_t voxels = dims_.x == 0 ? ~std::uint64_t{0} : voxels_of_block(dims_, block),
                      missing = mask & voxels;
  if (missing == 0) return;
  const std::uint64_t group = ISO_NO_DATA_WORDS * (block / ISO_NO_DATA_BLOCKS);
  const std::uint32_t bit = 1u << (block % ISO_NO_DATA_BLOCKS);
  made_.table_.resize(group + ISO_NO_DATA_WORDS);
  made_.num_voxels_ += static_cast<std::uint64_t>(std::popcount(missing));
  made_.table_[group + (missing == voxels ? 1 : 0)] |= bit;
  if (missing == voxels) return;
  masks_.push_back(static_cast<std::uint32_t>(missing));
  masks_.push_back(static_cast<std::uint32_t>(missing >> 32));
}

NoData NoDataBuilder::finish() {
  std::vector<std::uint32_t> &table = made_.table_;
  if (table.empty()) return {};
  const std::uint64_t groups = num_groups(count_);
  table.resize(no_data_masks_begin(count_));
  auto place = static_cast<std::uint32_t>(table.size() / 2);
  for (std::uint64_t group = 0; group < groups; ++group) {
    table[ISO_NO_DATA_WORDS * group + 2] = place;
    place += static_cast<std::uint32_t>(std::popcount(table[ISO_NO_DATA_WORDS * group]));
  }
  table.insert(table.end(), masks_.begin(), masks_.end());
  table.shrink_to_fit();
  return std::move(made_);
}

std::vector<std::uint32_t> no_data_groups(std::span<const std::uint32_t> table,
                                          std::uint64_t num_blocks) {
  std::vector<std::uint32_t> bits;
  bits.reserve(2 * num_groups(num_blocks));
  for (std::uint64_t group = 0; group < num_groups(num_blocks); ++group) {
    bits.push_back(table[ISO_NO_DATA_WORDS * group]);
    bits.push_back(table[ISO_NO_DATA_WORDS * group + 1]);
  }
  return bits;
}

std::span<const std::uint32_t> no_data_masks(std::span<const std::uint32_t> table,
                                             std::uint64_t num_blocks) {
  return table.subspan(no_data_masks_begin(num_blocks));
}

NoData cut_no_data(const NoData &whole, const glm::uvec3 &blocks, const BlockBox &box,
                   const glm::uvec3 &dims) {
  if (whole.empty()) return {};
  const glm::u64vec3 begin(box.begin), end(box.end), size(blocks);
  NoDataBuilder cut(dims);
  for (std::uint64_t z = begin.z; z < end.z; ++z) {
    for (std::uint64_t y = begin.y; y < end.y; ++y) {
      for (std::uint64_t x = begin.x; x < end.x; ++x)
        cut.add(whole.mask(x + size.x * (y + size.y * z)));
    }
  }
  return cut.finish();
}

void clear_no_data(std::uint64_t mask, std::span<float, ISO_BLOCK_VOXELS> voxels) {
  for (; mask != 0; mask &= mask - 1)
    voxels[static_cast<std::size_t>(std::countr_zero(mask))] =
        std::numeric_limits<float>::quiet_NaN();
}

void clear_no_data(const Chunk &chunk, const glm::uvec3 &dims) {
  const std::uint64_t blocks_x = (dims.x + 3u) / 4u, blocks_y = (dims.y + 3u) / 4u;
  for (std::uint64_t block = 0; block < chunk.no_data.size(); ++block) {
    const glm::u64vec3 first =
        std::uint64_t{kBlockEdge} *
        glm::u64vec3(block % blocks_x, block / blocks_x % blocks_y, block / blocks_x / blocks_y);
    const glm::ivec3 left(glm::u64vec3(dims.x, dims.y, chunk.num_layers) - first);
    for (std::uint64_t mask = chunk.no_data[block] & first_voxels(left.x, left.y, left.z);
         mask != 0; mask &= mask - 1) {
      const auto voxel = static_cast<std::uint64_t>(std::countr_zero(mask));
      chunk.voxels[first.x + voxel % 4 +
                   dims.x * (first.y + voxel / 4 % 4 + dims.y * (first.z + voxel / 16))] =
          std::numeric_limits<float>::quiet_NaN();
    }
  }
}

}  // namespace isowave::core
