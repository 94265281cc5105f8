// The value ranges of HostBlocks.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/parallel_for.hpp"
#include "core/host/host_blocks.hpp"
#include "core/view/frame.hpp"
#include "core/volume/range_thresholds.hpp"
#include "core/zfp/block_chunks.hpp"
#include "kernels_cl/portable/label_table.h"

namespace isowave::core {

namespace {

/// Blocks whose bits are read at a time.
constexpr std::uint64_t kRunBlocks = 1024;
constexpr std::uint32_t kMacrocellEdge = ISO_MACROCELL_BLOCKS;
constexpr float kLabelsEnd = ISO_NUM_LABELS;

void add(BlockRange &range, const BlockRange &by) {
  range.min = std::min(range.min, by.min);
  range.max = std::max(range.max, by.max);
}

}  // namespace

/// Those of macrocells alone, as a file of chunks has them.
void HostBlocks::take_ranges_of_chunks() {
  macrocell_ranges_.low = volume_->chunks->ranges().low;
  macrocell_ranges_.high = volume_->chunks->ranges().high;
  if (labels_.empty()) return;
  // The field of a group may have both its values between two labels.
  for (std::size_t i = 0; i < num_macrocells_; ++i) {
    float &low = macrocell_ranges_.low[i], &high = macrocell_ranges_.high[i];
    if (low > high) continue;
    if (low == high) {
      low = high = is_label(low) ? static_cast<float>(labels_[static_cast<uint>(low)]) : 0;
      continue;
    }
    const auto first = static_cast<std::size_t>(std::clamp(std::ceil(low), 0.0f, kLabelsEnd)),
               end = static_cast<std::size_t>(std::clamp(std::floor(high) + 1, 0.0f, kLabelsEnd));
    const bool any = std::any_of(labels_.begin() + std::ptrdiff_t(std::min(first, end)),
                                 labels_.begin() + std::ptrdiff_t(end),
                                 [](std::uint8_t is_in) { return is_in != 0; });
    low = 0;
    high = any ? 1 : 0;
  }
}

/// Layer by layer of blocks, since a block's dual cells have voxels of the layer above it.
void HostBlocks::find_ranges() {
  if (volume_->chunks) return take_ranges_of_chunks();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  ranges_.low.assign(64 * num_macrocells_, kInfinity);
  ranges_.high.assign(64 * num_macrocells_, -kInfinity);
  macrocell_ranges_.low.assign(num_macrocells_, kInfinity);
  macrocell_ranges_.high.assign(num_macrocells_, -kInfinity);
  std::vector<float> sampled(2 * range_sample(volume_->block_count()).count);
  std::vector<BlockRange> layer(8 * std::size_t{blocks_.x} * blocks_.y), above(layer.size());
  ranges_of_layer(0, layer, sampled);
  for (std::uint32_t z = 0; z < blocks_.z; ++z) {
    if (z + 1 < blocks_.z) ranges_of_layer(z + 1, above, sampled);
    set_dual_ranges(z, layer, above);
    layer.swap(above);
  }
  thresholds_ = range_thresholds(std::move(sampled));
}

void HostBlocks::show_labels(const std::vector<std::uint8_t> &labels) {
  if (labels == labels_) return;
  labels_ = labels;
  for (const auto &selection : selections_) selection->isovalue.reset();
  forget();
  find_ranges();
}

/// Voxels of a block, as the group's field has them.
void HostBlocks::to_group(float *values) const {
  for (uint v = 0; v < ISO_BLOCK_VOXELS; ++v)
    values[v] = is_label(values[v]) ? static_cast<float>(labels_[static_cast<uint>(values[v])]) : 0;
}

/// As HostLoops::ranges().
void HostBlocks::ranges_of_labels(const EncodedBlock &block, BlockRange *parts) const {
  alignas(64) std::array<float, ISO_BLOCK_VOXELS> values;
  host_loops().decode(block, values.data());
  to_group(values.data());
  for (uint part = 0; part < 8; ++part) {
    const uint end_x = (part & 1) != 0 ? 1 : block.size_x,
               end_y = (part & 2) != 0 ? 1 : block.size_y,
               end_z = (part & 4) != 0 ? 1 : block.size_z;
    parts[part] = {1, 0};
    for (uint z = 0; z < end_z; ++z) {
      for (uint y = 0; y < end_y; ++y) {
        for (uint x = 0; x < end_x; ++x) {
          const float value = values[x + 4 * y + 16 * z];
          add(parts[part], {value, value});
        }
      }
    }
  }
}

/// Writes the value ranges of the eight parts of each block of layer z.
///
/// ranges   [block][8]
/// sampled  gets the ranges of the blocks that thresholds are made of
void HostBlocks::ranges_of_layer(std::uint32_t z, std::span<BlockRange> ranges,
                                 std::span<float> sampled) const {
  const std::uint64_t num_blocks = std::uint64_t{blocks_.x} * blocks_.y, layer = z * num_blocks;
  const RangeSample sample = range_sample(volume_->block_count());
  parallel_for(
      (num_blocks + kRunBlocks - 1) / kRunBlocks, num_threads_,
      [&](std::uint64_t run, std::uint32_t) {
        const std::uint64_t first = layer + run * kRunBlocks,
                            end = layer + std::min(num_blocks, (run + 1) * kRunBlocks);
        std::vector<uint> words;
        std::uint64_t begin_bit = 0;
        if (volume_->file) {
          begin_bit = volume_->block_begin(first);
          words.resize((volume_->block_begin(end) - begin_bit + 31) / 32 + kDecoderAhead);
          volume_->read_words(begin_bit, words);
        }
        for (std::uint64_t block = first; block < end; ++block) {
          EncodedBlock bits = encoded(block);
          const glm::uvec3 size = volume_->info.dims - 4u * place_of(block, blocks_);
          bits.size_x = std::min(size.x, 4u);
          bits.size_y = std::min(size.y, 4u);
          bits.size_z = std::min(size.z, 4u);
          if (volume_->file) bits.words = words.data();
          bits.first_bit -= begin_bit;
          BlockRange *parts = ranges.data() + 8 * (block - layer);
          if (labels_.empty()) {
            host_loops().ranges(bits, parts);
          } else {
            ranges_of_labels(bits, parts);
          }
          const std::uint64_t number = block / sample.stride;
          if (number >= sample.count ||
              sampled_block(static_cast<uint>(number * sample.stride), sample.stride) != block)
            continue;
          sampled[2 * number] = parts[0].min;
          sampled[2 * number + 1] = parts[0].max;
        }
      });
}

/// Sets the ranges of dual grids of layer z, from ranges_of_layer() of z and of z + 1.
void HostBlocks::set_dual_ranges(std::uint32_t z, std::span<const BlockRange> layer,
                                 std::span<const BlockRange> above) {
  const glm::uvec3 dims = volume_->info.dims;
  if (z >= num_owning_blocks(dims.z)) return;
  const glm::uvec2 owning(num_owning_blocks(dims.x), num_owning_blocks(dims.y));
  // Rows of macrocells, so that no two threads write to one.
  parallel_for(macrocells_.y, num_threads_, [&](std::uint64_t row, std::uint32_t) {
    const auto begin = static_cast<uint>(kMacrocellEdge * row),
               end = std::min(begin + kMacrocellEdge, owning.y);
    for (uint y = begin; y < end; ++y) {
      for (uint x = 0; x < owning.x; ++x) {
        BlockRange range = layer[8 * (x + std::size_t{blocks_.x} * y)];
        for (uint corner = 1; corner < 8; ++corner) {
          const glm::uvec3 at = glm::uvec3(x, y, z) + corner_of(corner);
          if (!glm::all(glm::lessThan(at, blocks_))) continue;
          add(range,
              (at.z > z ? above : layer)[8 * (at.x + std::size_t{blocks_.x} * at.y) + corner]);
        }
        const std::size_t macrocell =
            x / kMacrocellEdge +
            macrocells_.x * (row + std::size_t{macrocells_.y} * (z / kMacrocellEdge));
        const std::size_t i = 64 * macrocell + x % kMacrocellEdge + 4 * (y % kMacrocellEdge) +
                              16 * (z % kMacrocellEdge);
        ranges_.low[i] = range.min;
        ranges_.high[i] = range.max;
        float &low = macrocell_ranges_.low[macrocell], &high = macrocell_ranges_.high[macrocell];
        low = std::min(low, range.min);
        high = std::max(high, range.max);
      }
    }
  });
}

}  // namespace isowave::core
