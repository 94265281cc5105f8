#pragma once
// A fixed number of slots for decoded blocks; the least recently used are replaced (Sec. 3.4, 3.5).
// In: the blocks that a pass requests; out: the list of blocks to decode and their slots.

#include "core/stages/slot_type.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/block_cache.hpp"
#include "kernels_cl/portable/block_table.h"

namespace isowave::core {

/// The fewest slots that still draw every picture: one dual grid.
inline constexpr std::uint32_t kMinCacheSlots = 8;

/// The cache, as the stages of one pass read it, and its requests.
struct BlockCache {
  /// Limits that the lengths of its buffers follow from.
  struct Limits {
    std::uint32_t num_slots = kMinCacheSlots;  ///< at least that many
    std::uint64_t num_rays = 0;                ///< bounds a pass's pairs
    std::uint64_t num_blocks = 0;              ///< of all levels of detail, by their ids
    std::uint64_t num_macrocells = 0;          ///< of these blocks
    std::uint32_t blocks_x = 0, blocks_y = 0;  ///< of the grid in which their ids count
    SlotType slot_type = SlotType::kFloat32;

    /// The most requests that are listed: no more than can be granted. A ray's block requests at
    /// most 8 blocks, and a block is listed once.
    std::uint32_t max_requests() const;
  };
  /// Limits for the blocks of `grid`: of make_id_grid() if there are several levels of detail.
  static Limits limits_for(const BlockGrid &grid, std::uint32_t num_slots, std::uint64_t num_rays,
                           SlotType slot_type = SlotType::kFloat32) {
    return {num_slots,     num_rays,      block_count(grid), core::num_macrocells(grid),
            grid.blocks_x, grid.blocks_y, slot_type};
  }
  static ocl::BufferSizes sizes(const Limits &limits);

  /// levels  frames may have several levels of detail
  /// Throws  Error: fewer than kMinCacheSlots, or more than ISO_MAX_CACHE_SLOTS
  BlockCache(ocl::Device &device, const Limits &limits, std::uint32_t group_size,
             bool levels = false);

  /// Lists the missing blocks of every pair's dual grid, once each, and stamps the cached ones.
  /// Pipeline `rays` uses RequestAhead instead.
  ///
  /// In     rays.pair_block_ids
  /// Out    request_block_ids; counts.requested_count
  /// Waits  no
  void request(Wavefront &rays);
  /// Frees the slots that were used longest ago, as many as this pass's requests need beyond the
  /// free ones, but none that the pass uses. The block that is served first always gets its slots.
  ///
  /// asked  the counts that hold requested_count
  /// Waits  no
  void evict(const CountsBuffer &asked, Wavefront &rays);
  /// Gives the free slots to requests.
  ///
  /// asked  the counts that hold requested_count
  /// Out    request_block_ids, decode_slots [counts.decoded_count]
  /// Waits  no
  void assign(const CountsBuffer &asked, Wavefront &rays);

  /// Counts the cached blocks whose voxels the rays of the pass at work have looked at, for
  /// touched_blocks().
  ///
  /// in_dual_grids  a stamp stands for a block's whole dual grid, as march sets it
  /// Waits          no
  void count_touched(Wavefront &rays, bool in_dual_grids);
  /// The last count.
  ///
  /// Waits  yes
  std::uint32_t touched_blocks() const { return touched_.read().front(); }

  /// Brings `inside` and `changing` up to date with another isovalue of rays.frame. Does not wait.
  void classify(Wavefront &rays);

  /// Forgets every block: the next pass finds the cache as it was made. Does not wait.
  void clear();

  /// Becomes an empty cache with other limits. Its buffers are freed before new ones are made, so
  /// the peak of memory is that of the larger cache.
  ///
  /// limits  differ only in num_slots
  /// Throws  Error: the device has not enough memory; there is no cache until another call succeeds
  /// Waits   yes
  void resize(const Limits &limits);

  SlotType slot_type;
  std::uint32_t num_slots;
  std::uint32_t capacity;   ///< of the request list: requests beyond it are dropped
  ocl::Buffer<uint> table;  ///< block -> slot: kernels_cl/portable/block_table.h
  /// [num_slots * 64] decoded values, of slot_type, x + 4y + 16z within a slot
  ocl::Buffer<SlotValue> values;
  ocl::Buffer<ulong> inside;         ///< [num_slots] bit x + 4y + 16z: is value >= isovalue?
  ocl::Buffer<ulong> changing;       ///< [num_slots] ... does inside change in the cell?
                                     ///< ISO_CHANGING_UNKNOWN: no ray has looked
  ocl::Buffer<uint> slot_block_ids;  ///< [num_slots] block in each slot or ISO_INVALID_ID
  ocl::Buffer<uint>
      slot_stamps;  ///< [num_slots] when it was used last: kernels_cl/device/slot_stamps.h
  ocl::Buffer<uint> free_slots;  ///< [num_slots] the first state.free_count hold no block
  ocl::Buffer<uint>
      requested_bits;  ///< [2 * coarse macrocells] one bit per block; 0 between passes
  ocl::Buffer<uint> request_block_ids;  ///< [capacity]
  ocl::Buffer<uint> decode_slots;       ///< [capacity] slot of each request granted
  ocl::Buffer<CacheState> state;        ///< [1]

 private:
  /// clear() of buffers that were just made.
  void make_empty();
  void clear(uint directory_words);

  BlockCache(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
             std::uint32_t group_size, const ocl::Defines &defines);

  std::uint32_t group_size_, blocks_x_, blocks_y_;
  ocl::Range pairs_range_, slots_range_, requests_range_;
  ocl::Buffer<uchar> slot_ranks_;  ///< [num_slots] orders of eviction
  ocl::Buffer<uint> rank_histogram_;
  ocl::Buffer<uint> touched_;  ///< [1]
  ocl::Kernel<kernels::cache_request> request_;
  ocl::Kernel<kernels::cache_rank> rank_;
  ocl::Kernel<kernels::cache_select> select_;
  ocl::Kernel<kernels::cache_evict> evict_;
  ocl::Kernel<kernels::cache_classify> classify_;
  ocl::Kernel<kernels::cache_assign> assign_;
  ocl::Kernel<kernels::cache_touched> count_touched_;
  ocl::Kernel<kernels::cache_clear> clear_;
};

}  // namespace isowave::core
