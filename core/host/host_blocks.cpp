#include "core/host/host_blocks.hpp"

#include <algorithm>
#include <limits>
#include <mutex>

#include "core/base/parallel_for.hpp"
#include "core/view/frame.hpp"
#include "core/volume/range_thresholds.hpp"
#include "kernels_cl/portable/block_cells.h"

namespace isowave::core {

namespace {

/// Blocks whose bits are read at a time.
constexpr std::uint64_t kRunBlocks = 1024;
constexpr std::uint32_t kEdge = ISO_MACROCELL_BLOCKS;

glm::uvec3 blocks_of(const BlockGrid &grid) {
  return {grid.blocks_x, grid.blocks_y, grid.blocks_z};
}

/// Item `id` of a grid, x first.
glm::uvec3 place_of(std::uint64_t id, const glm::uvec3 &size) {
  return {id % size.x, id / size.x % size.y, id / size.x / size.y};
}

/// Blocks that own dual cells, along each axis.
glm::uvec3 owning_blocks(const BlockGrid &grid) {
  return {num_owning_blocks(grid.dims_x), num_owning_blocks(grid.dims_y),
          num_owning_blocks(grid.dims_z)};
}

void add(std::optional<BlockBox> &box, const glm::ivec3 &block) {
  if (!box) box = BlockBox{block, block + 1};
  box->begin = glm::min(box->begin, block);
  box->end = glm::max(box->end, block + 1);
}

void add(std::optional<BlockBox> &box, const std::optional<BlockBox> &other) {
  if (!other) return;
  add(box, other->begin);
  add(box, other->end - 1);
}

}  // namespace

std::uint64_t HostBlocks::bytes(const VolumeInfo &info) {
  const BlockGrid grid = make_grid(info);
  return block_count(grid) *
             (ISO_BLOCK_VOXELS * sizeof(float) + sizeof(BlockRange) + 2 * sizeof(ulong)) +
         num_macrocells(grid) * sizeof(ulong) + kNumThresholds * sizeof(float);
}

HostBlocks::HostBlocks(const CompressedVolume &volume, std::uint32_t num_threads)
    : num_threads_(num_threads),
      grid_(make_grid(volume.info)),
      values_(std::make_unique_for_overwrite<float[]>(ISO_BLOCK_VOXELS * volume.block_count())),
      ranges_(volume.block_count()),
      inside_(volume.block_count()),
      changing_(volume.block_count()),
      masks_(num_macrocells(grid_)) {
  const HostLoops &loops = host_loops();
  const std::uint64_t num_blocks = volume.block_count();
  const glm::uvec3 dims = volume.info.dims, blocks = blocks_of(grid_);
  parallel_for(
      (num_blocks + kRunBlocks - 1) / kRunBlocks, num_threads_,
      [&](std::uint64_t run, std::uint32_t) {
        const std::uint64_t first = run * kRunBlocks,
                            end = std::min(num_blocks, first + kRunBlocks);
        const std::uint64_t begin_bit = volume.block_begin(static_cast<std::uint32_t>(first)),
                            end_bit = volume.block_begin(static_cast<std::uint32_t>(end));
        std::vector<uint> words((end_bit - begin_bit + 31) / 32 + kDecoderAhead);
        volume.read_words(begin_bit, words);
        for (std::uint64_t id = first; id < end; ++id) {
          const auto block = static_cast<std::uint32_t>(id);
          const glm::uvec3 size = glm::min(dims - 4u * place_of(id, blocks), glm::uvec3(4));
          ranges_[id] = loops.decode({.words = words.data(),
                                      .first_bit = volume.block_begin(block) - begin_bit,
                                      .num_bits = volume.block_bits(block),
                                      .min_exponent = volume.precision.min_exponent,
                                      .whole_numbers = volume.precision.whole_numbers,
                                      .size_x = size.x,
                                      .size_y = size.y,
                                      .size_z = size.z},
                                     values_.get() + ISO_BLOCK_VOXELS * id);
        }
      });
  const RangeSample sample = range_sample(num_blocks);
  std::vector<float> values;
  for (std::uint32_t i = 0; i < sample.count; ++i) {
    const BlockRange &range = ranges_[sampled_block(i * sample.stride, sample.stride)];
    values.push_back(range.min);
    values.push_back(range.max);
  }
  thresholds_ = range_thresholds(std::move(values));
}

/// Voxel by voxel only where they are on both sides. Rounding keeps the order of differences.
ulong HostBlocks::inside_of(std::size_t block, float isovalue) const {
  if (ranges_[block].min - isovalue >= 0.0f) return ~ulong{0};
  if (!(ranges_[block].max - isovalue >= 0.0f)) return 0;
  return host_loops().inside(values_.get() + ISO_BLOCK_VOXELS * block, isovalue);
}

/// Padding, and blocks beyond the volume, matter to cells outside it alone: any voxels stand for
/// them.
ulong HostBlocks::find_changing(const glm::uvec3 &block) const {
  ulong inside[8], any = 0, all = ~ulong{0};
  for (uint corner = 0; corner < 8; ++corner) {
    const glm::uvec3 at = block + glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2);
    inside[corner] = inside_[block_at(glm::min(at, blocks_of(grid_) - 1u))];
    any |= inside[corner];
    all &= inside[corner];
  }
  return any == 0 || ~all == 0 ? 0 : changing_cells(inside);
}

void HostBlocks::select(float isovalue) {
  if (selected_ == isovalue) return;
  selected_.reset();
  const glm::uvec3 blocks = blocks_of(grid_), owning = owning_blocks(grid_),
                   macrocells = (blocks + kEdge - 1u) / kEdge;
  parallel_for((inside_.size() + kRunBlocks - 1) / kRunBlocks, num_threads_,
               [&](std::uint64_t run, std::uint32_t) {
                 const std::size_t end = std::min(inside_.size(), (run + 1) * kRunBlocks);
                 for (std::size_t block = run * kRunBlocks; block < end; ++block)
                   inside_[block] = inside_of(block, isovalue);
               });
  std::optional<BlockBox> box;
  std::mutex box_mutex;
  parallel_for(masks_.size(), num_threads_, [&](std::uint64_t macrocell, std::uint32_t) {
    std::optional<BlockBox> box_here;
    ulong mask = 0;
    const glm::uvec3 first = kEdge * place_of(macrocell, macrocells);
    for (uint bit = 0; bit < 64; ++bit) {
      const glm::uvec3 block = first + glm::uvec3(bit & 3, bit >> 2 & 3, bit >> 4);
      if (!glm::all(glm::lessThan(block, owning))) continue;
      const ulong changing = changing_[block_at(block)] = find_changing(block);
      if (changing == 0) continue;
      mask |= ulong{1} << bit;
      add(box_here, glm::ivec3(block));
    }
    masks_[macrocell] = mask;
    if (!box_here) return;
    const std::lock_guard lock(box_mutex);
    add(box, box_here);
  });
  const BlockBox around = box.value_or(BlockBox{glm::ivec3(0), glm::ivec3(0)});
  surface_ = {.isovalue = isovalue,
              .isovalue_index = 0,
              .active_begin_x = around.begin.x,
              .active_begin_y = around.begin.y,
              .active_begin_z = around.begin.z,
              .active_end_x = around.end.x,
              .active_end_y = around.end.y,
              .active_end_z = around.end.z};
  selected_ = isovalue;
}

/// Of all voxels of the blocks that a block's dual cells have voxels of.
BlockRange HostBlocks::neighbours_range(const glm::uvec3 &block) const {
  BlockRange range = ranges_[block_at(block)];
  for (uint corner = 1; corner < 8; ++corner) {
    const glm::uvec3 at = block + glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2);
    const BlockRange &other = ranges_[block_at(glm::min(at, blocks_of(grid_) - 1u))];
    range.min = std::min(range.min, other.min);
    range.max = std::max(range.max, other.max);
  }
  return range;
}

/// Of the voxels of a block's dual cells: its own, and the first layers of its neighbours.
BlockRange HostBlocks::dual_range(const glm::uvec3 &block) const {
  BlockRange range = ranges_[block_at(block)];
  const glm::uvec3 begin = 4u * block,
                   end = glm::min(begin + 5u, glm::uvec3(grid_.dims_x, grid_.dims_y, grid_.dims_z));
  for (uint z = begin.z; z < end.z; ++z) {
    for (uint y = begin.y; y < end.y; ++y) {
      for (uint x = begin.x; x < end.x; ++x) {
        const float value = values_[ISO_BLOCK_VOXELS * block_at({x / 4, y / 4, z / 4}) + x % 4 +
                                    4 * (y % 4) + 16 * (z % 4)];
        range.min = std::min(range.min, value);
        range.max = std::max(range.max, value);
      }
    }
  }
  return range;
}

/// macrocell_masks() takes a block as active whose range, rounded outward to thresholds, has values
/// below the isovalue and values not below it.
std::optional<BlockBox> HostBlocks::rounded_box(float isovalue) const {
  const std::uint32_t index = threshold_index(thresholds_, double{isovalue});
  if (index == 0 || index == kNumThresholds) return {};
  const float below = thresholds_[index - 1], above = thresholds_[index];
  const auto holds = [&](const BlockRange &range) {
    return range.min < above && range.max > below;
  };
  const glm::uvec3 owning = owning_blocks(grid_);
  std::optional<BlockBox> box;
  std::mutex box_mutex;
  parallel_for(owning.z, num_threads_, [&](std::uint64_t z, std::uint32_t) {
    std::optional<BlockBox> box_here;
    for (uint y = 0; y < owning.y; ++y) {
      for (uint x = 0; x < owning.x; ++x) {
        const glm::uvec3 block(x, y, z);
        if (holds(ranges_[block_at(block)]) ||
            (holds(neighbours_range(block)) && holds(dual_range(block))))
          add(box_here, glm::ivec3(block));
      }
    }
    const std::lock_guard lock(box_mutex);
    add(box, box_here);
  });
  return box;
}

}  // namespace isowave::core
