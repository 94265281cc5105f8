#pragma once
// Masks of active blocks -> a list of the blocks that an isosurface is extracted from
// (kernels_cl/active_blocks.cl).

#include "core/stages/prefix_sum.hpp"
#include "kernels/active_blocks.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

class ActiveBlocks {
 public:
  /// num_macrocells: of the volume. The list itself is the caller's.
  static ocl::BufferSizes sizes(std::uint64_t num_macrocells);
  ActiveBlocks(ocl::Device &device, std::uint64_t num_macrocells);

  /// Finds the blocks that are active, or own no cell and hold edges of one that is.
  ///
  /// frame    its grid is used: of a volume without levels of detail
  /// masks    Macrocells::masks()
  /// Returns  how many there are
  /// Waits    yes
  std::uint32_t count(const FrameParams &frame, const ocl::Buffer<uint> &masks);
  /// Lists the blocks that count() found last.
  ///
  /// Out    block_ids [count()]: by macrocell, then by place in it
  /// Waits  no
  void list(const FrameParams &frame, ocl::Buffer<uint> &block_ids);

  /// [2 * macrocells] bit x + 4y + 16z of each block that is listed, 32 bits a word.
  const ocl::Buffer<uint> &masks() const { return masks_; }
  /// [macrocells + 1] place of each macrocell's first block on the list.
  const ocl::Buffer<uint> &offsets() const { return offsets_; }

 private:
  std::uint32_t num_macrocells_;
  ocl::Range range_;
  ocl::Buffer<uint> masks_, offsets_;
  PrefixSum sum_;
  ocl::Kernel<kernels::active_masks> masks_kernel_;
  ocl::Kernel<kernels::active_list> list_kernel_;
};

}  // namespace isowave::core
