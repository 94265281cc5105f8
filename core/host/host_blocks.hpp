#pragma once
// A volume decoded into host memory, block by block, and where an isovalue is crossed in it.

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/host/host_loops.hpp"
#include "core/volume/block_box.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

class HostBlocks {
 public:
  /// Memory of a volume with this grid.
  static std::uint64_t bytes(const VolumeInfo &info);

  /// Decodes the finest level.
  ///
  /// volume       need not outlive this
  /// num_threads  0: one per processor
  /// Throws       Error: a file that the volume is in has become shorter, or cannot be read
  HostBlocks(const CompressedVolume &volume, std::uint32_t num_threads);

  /// Finds the cells whose corners are not all on one side of an isovalue, for field() and
  /// surface(). Nothing to do where it is the one in use. Cells of no other can have a hit
  /// (cell_intersect.h), so that rays may skip them.
  void select(float isovalue);

  /// What rays walk through. Stays valid until the next select().
  HostField field() const { return {values_.get(), changing_.data(), masks_.data()}; }
  /// The selected isovalue, and the box around the blocks that have such a cell.
  const Surface &surface() const { return surface_; }

  /// The box around the blocks that hold an isovalue as far as Macrocells knows, which keeps value
  /// ranges in 8 bits: views that are made of it are those of a device.
  ///
  /// Returns  nothing where there is no block
  std::optional<BlockBox> rounded_box(float isovalue) const;

 private:
  BlockRange neighbours_range(const glm::uvec3 &block) const;
  BlockRange dual_range(const glm::uvec3 &block) const;
  std::size_t block_at(const glm::uvec3 &block) const {
    return block.x + grid_.blocks_x * (block.y + std::size_t{grid_.blocks_y} * block.z);
  }
  ulong inside_of(std::size_t block, float isovalue) const;
  ulong find_changing(const glm::uvec3 &block) const;

  std::uint32_t num_threads_;
  BlockGrid grid_;
  std::unique_ptr<float[]> values_;  ///< [block][64]; not cleared: threads do while they decode
  std::vector<BlockRange> ranges_;   ///< [block] of its own voxels
  std::vector<ulong> inside_, changing_, masks_;
  std::vector<float> thresholds_;
  std::optional<float> selected_;
  Surface surface_{};
};

}  // namespace isowave::core
