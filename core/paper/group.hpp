#pragma once
// Ray-block pairs whose dual grid is cached -> the same pairs gathered by block (Sec. 3.6, 4.2).

#include <string_view>
#include <variant>

#include "core/paper/closest_hit.hpp"
#include "core/paper/radix_sort.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/wavefront.hpp"
#include "kernels/group.hpp"

namespace isowave::core {

/// How pairs are gathered. The picture has the same bits either way.
enum class Grouping {
  kRadix,    ///< stable radix sort by cache slot (Sec. 3.6): scratch of 8 bytes a pixel
  kCounting  ///< counts per slot, places for the visible ones, scatter: scratch of 8 bytes a cache
             ///< slot
};
inline constexpr Grouping kDefaultGrouping = Grouping::kCounting;

/// "radix", "counting".
std::string_view to_string(Grouping grouping);
/// Throws  Error naming both
Grouping grouping_from_string(std::string_view name);

/// The pass's work for intersection. Pairs of one block lie together; which block comes first is
/// left open.
struct BlockGroups {
  ocl::Buffer<uint> pair_ids;  ///< [granted_count] entries of pair_block_ids, by block (I_RAct)
  ocl::Buffer<BlockRays>
      block_rays;  ///< [visible_count] each block's part of pair_ids (O_BRays, N_BRays)
};

class Group {
 public:
  /// Limits that the lengths of its buffers follow from.
  struct Limits {
    std::uint64_t num_rays = 0;   ///< bounds a pass's pairs
    std::uint32_t num_slots = 0;  ///< of the cache
    std::uint32_t group_size = 64;
    Grouping grouping = kDefaultGrouping;
  };
  static ocl::BufferSizes sizes(const Limits &limits);

  Group(ocl::Device &device, const Limits &limits, ClosestHit closest = kDefaultClosestHit);

  /// Takes time in proportion to the pairs. Overwrites rays.mask.
  ///
  /// In     rays.pair_block_ids; counts.granted_count, visible_count: 0, as begin_pass leaves them
  /// Out    groups(), both counts; the other pairs are marked "not tested"
  /// Waits  no
  void operator()(const BlockCache &cache, Wavefront &rays);

  const BlockGroups &groups() const { return groups_; }

  /// For a cache of so many slots from now on: as BlockCache::resize().
  void resize(std::uint32_t num_slots);

 private:
  struct ByRadix {
    ByRadix(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
            const ocl::Defines &defines);
    void operator()(const BlockCache &cache, Wavefront &rays, ocl::Buffer<uint> &keys,
                    BlockGroups &groups);
    void resize(const Limits &limits, const ocl::BufferSizes &sizes, ocl::Device &device);

    ocl::Range pair_tiles_range, key_tiles_range;
    std::uint32_t key_bits;
    RadixSort sort;
    ocl::Buffer<uint> tile_sums;
    ocl::Kernel<kernels::group_select> select;
    ocl::Kernel<kernels::group_head_sums> head_sums;
    ocl::Kernel<kernels::group_heads> heads;
  };

  struct ByCounting {
    ByCounting(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
               const ocl::Defines &defines);
    void operator()(const BlockCache &cache, Wavefront &rays, ocl::Buffer<uint> &pair_slots,
                    BlockGroups &groups);
    void resize(const Limits &limits, const ocl::BufferSizes &sizes, ocl::Device &device);

    ocl::Range pair_tiles_range, candidates_range, pairs_range;
    ocl::Buffer<uint> slot_counts;      ///< [slots] 0 between passes
    ocl::Buffer<uint> slot_offsets;     ///< [slots] of blocks that the pass's pairs ask for
    ocl::Buffer<uint> candidate_count;  ///< [1] 0 between passes
    ocl::Kernel<kernels::group_count> count;
    ocl::Kernel<kernels::group_blocks> blocks;
    ocl::Kernel<kernels::group_scatter> scatter;
  };

  using Gather = std::variant<ByRadix, ByCounting>;

  Group(ocl::Device &device, const Limits &limits, const ocl::BufferSizes &sizes,
        const ocl::Defines &defines);
  static Gather make_gather(ocl::Device &device, const Limits &limits,
                            const ocl::BufferSizes &sizes, const ocl::Defines &defines);

  ocl::Device &device_;
  Limits limits_;
  BlockGroups groups_;
  ocl::Buffer<uint>
      pair_slots_;  ///< [R] by radix the keys of the sort, else slots of pairs' blocks, by pair
  Gather gather_;
};

}  // namespace isowave::core
