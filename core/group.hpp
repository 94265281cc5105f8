#pragma once
// Ray-block pairs whose dual grid is cached -> the same pairs gathered by block (Sec. 3.6, 4.2).

#include "core/block_cache.hpp"
#include "core/ocl/kernel.hpp"
#include "core/radix_sort.hpp"
#include "core/scan.hpp"
#include "core/wavefront.hpp"

namespace isowave {

/// The pass's work for intersection.
struct BlockGroups {
  ocl::Buffer<uint> pair_ids;  ///< [granted_count] entries of pair_block_ids, sorted by slot (I_RAct)
  ocl::Buffer<uint> slots;     ///< [granted_count] slot of each pair's block (I_RActBID)
  ocl::Buffer<uint> block_ray_offsets;  ///< [visible_count] where each block's pairs begin (O_BRays)
};

class Group {
 public:
  Group(ocl::Device &device, std::uint64_t num_pixels, std::uint32_t num_slots, std::uint32_t group_size);

  /// Out: groups(), counts.granted_count, counts.visible_count; pair_hits are marked "not tested".
  /// Asynchronous.
  void operator()(const BlockCache &cache, Wavefront &rays, Compaction &compaction);

  const BlockGroups &groups() const { return groups_; }

 private:
  ocl::Range range_;
  std::uint32_t key_bits_;
  BlockGroups groups_;
  RadixSort sort_;
  ocl::Kernel<ocl::In<FrameParams>, ocl::In<PassCounts>, ocl::In<uint>, ocl::In<BlockEntry>,
              ocl::Out<PairHit>, ocl::Out<uint>>
      select_;
  ocl::Kernel<ocl::In<FrameParams>, ocl::In<PassCounts>, ocl::In<uint>, ocl::In<uint>, ocl::In<BlockEntry>,
              ocl::Out<uint>>
      keys_;
  ocl::Kernel<ocl::In<PassCounts>, ocl::In<uint>, ocl::Out<uint>> heads_;
};

}  // namespace isowave
