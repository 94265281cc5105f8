#pragma once
// A fixed number of slots for decoded blocks, least recently used ones replaced (Sec. 3.4, 3.5).
// In: the blocks that a pass's pairs ask for; out: the list of blocks to decode and their slots.

#include "core/ocl/kernel.hpp"
#include "core/wavefront.hpp"

namespace isowave {

/// The fewest slots that still draw every picture: one dual grid.
inline constexpr std::uint32_t kMinCacheSlots = 8;

class BlockCache {
 public:
  /// num_slots is at least kMinCacheSlots; num_pixels bounds a pass's pairs. Throws Error when there are too
  /// few slots, or more than 2^30.
  BlockCache(ocl::Device &device, std::uint64_t num_blocks, std::uint32_t num_slots, std::uint64_t num_pixels,
             std::uint32_t group_size);

  /// Lists the missing blocks of every pair's dual grid, once each, and stamps the cached ones. Out:
  /// counts.requested_count. Asynchronous.
  void request(Wavefront &rays);
  /// Grants as many requests as slots can be freed without taking one that this pass uses; the first pair of
  /// the first active ray is served whatever it takes. Out: counts.decoded_count; decode_block_ids() and
  /// decode_slots() hold that many. Asynchronous.
  void assign_slots(Wavefront &rays);

  /// Forgets every block: the next pass finds the cache as it was made. O(blocks): not for the pass loop.
  /// Asynchronous.
  void clear();

  std::uint32_t num_slots() const { return num_slots_; }
  /// [blocks] slot of each block; ISO_BLOCK_ABSENT if not cached.
  const ocl::Buffer<uint> &page_table() const { return page_table_; }
  /// [num_slots] block in each slot or ISO_INVALID_ID.
  const ocl::Buffer<uint> &slot_block_ids() const { return slot_block_ids_; }
  /// [num_slots * 64] decoded values, x + 4y + 16z within a slot.
  const ocl::Buffer<float> &values() const { return values_; }
  ocl::Buffer<float> &values() { return values_; }
  const ocl::Buffer<uint> &decode_block_ids() const { return request_block_ids_; }
  const ocl::Buffer<uint> &decode_slots() const { return victim_slots_; }

 private:
  /// Mirrors CacheSelection of block_cache.cl; only kernels look inside.
  struct Selection {
    uint fields[5];
  };

  std::uint32_t num_slots_;
  std::uint32_t group_size_;
  ocl::Range pairs_range_, slots_range_, requests_range_;
  ocl::Buffer<uint> page_table_, slot_block_ids_, slot_stamps_, request_block_ids_, victim_slots_,
      age_histogram_;
  ocl::Buffer<Selection> selection_;
  ocl::Buffer<float> values_;
  ocl::Kernel<ocl::In<FrameParams>, ocl::Out<PassCounts>, ocl::In<uint>, ocl::Out<uint>, ocl::Out<uint>,
              ocl::Out<uint>>
      request_;
  ocl::Kernel<ocl::In<PassCounts>, uint, ocl::In<uint>, ocl::Out<uint>> age_histogram_kernel_;
  ocl::Kernel<ocl::In<FrameParams>, ocl::Out<PassCounts>, uint, ocl::In<uint>, ocl::In<uint>, ocl::Out<uint>,
              ocl::Out<uint>, ocl::Out<uint>, ocl::Out<Selection>>
      select_;
  ocl::Kernel<ocl::In<PassCounts>, uint, ocl::In<uint>, ocl::Out<Selection>, ocl::Out<uint>> collect_victims_;
  ocl::Kernel<ocl::In<PassCounts>, ocl::In<uint>, ocl::In<uint>, ocl::Out<uint>, ocl::Out<uint>,
              ocl::Out<uint>>
      assign_;
};

}  // namespace isowave
