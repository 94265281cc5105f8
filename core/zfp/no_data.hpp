#pragma once
// The voxels of a compressed volume without data: nothing is known there, so cells that touch
// them have no surface. The stream has an ordinary value for them, which is never used.

#include <cstdint>
#include <span>
#include <vector>

#include "core/volume/block_box.hpp"
#include "core/volume/volume.hpp"
#include "core/volume/voxel_chunks.hpp"
#include "kernels_cl/portable/no_data.h"

namespace isowave::core {

/// The voxels of a volume without data. Takes no memory if there are none.
class NoData {
 public:
  NoData() = default;
  /// Keeps the number of voxels alone.
  explicit NoData(std::uint64_t num_voxels) : num_voxels_(num_voxels) {}

  bool empty() const { return num_voxels_ == 0; }
  /// The table of kernels_cl/portable/no_data.h; empty if all voxels have data.
  std::span<const std::uint32_t> table() const { return table_; }
  /// Bit x + 4y + 16z of a block: the voxel has no data.
  std::uint64_t mask(std::uint64_t block) const {
    return table_.empty() ? 0 : no_data_mask(table_.data(), block);
  }
  /// How many voxels have no data.
  std::uint64_t num_voxels() const { return num_voxels_; }

 private:
  friend class NoDataBuilder;
  std::vector<std::uint32_t> table_{};
  std::uint64_t num_voxels_ = 0;
};

/// Makes NoData block by block.
class NoDataBuilder {
 public:
  /// dims: of the volume
  explicit NoDataBuilder(const glm::uvec3 &dims) : dims_(dims) {}
  /// For blocks of any volumes: masks have no bits beyond these, or all 64.
  NoDataBuilder() = default;
  /// mask: of the next block; bits of its voxels beyond the volume do not matter.
  void add(std::uint64_t mask);
  /// After the last block.
  NoData finish();

 private:
  glm::uvec3 dims_{0};       ///< 0: of any volumes
  std::uint64_t count_ = 0;  ///< blocks so far
  NoData made_;              ///< so far its groups, without places
  std::vector<std::uint32_t> masks_{};
};

/// The two parts of a table: two words of bits for each group of 32 blocks, without the places of
/// masks; and the words of all masks.
std::vector<std::uint32_t> no_data_groups(std::span<const std::uint32_t> table,
                                          std::uint64_t num_blocks);
std::span<const std::uint32_t> no_data_masks(std::span<const std::uint32_t> table,
                                             std::uint64_t num_blocks);
/// The word of a table that its masks begin with: an even one, since places count pairs.
std::uint64_t no_data_masks_begin(std::uint64_t num_blocks);

/// The voxels without data of a box of blocks of a volume of `blocks` blocks. dims: of the box.
NoData cut_no_data(const NoData &whole, const glm::uvec3 &blocks, const BlockBox &box,
                   const glm::uvec3 &dims);

/// The bits x + 4y + 16z of the voxels that block number `block` has within the volume.
std::uint64_t voxels_of_block(const glm::uvec3 &dims, std::uint64_t block);

/// Sets the voxels of a mask to NaN. voxels [64]: x + 4y + 16z.
void clear_no_data(std::uint64_t mask, std::span<float, ISO_BLOCK_VOXELS> voxels);
/// Sets the voxels of a chunk without data to NaN. dims: of the volume.
void clear_no_data(const Chunk &chunk, const glm::uvec3 &dims);

}  // namespace isowave::core
