#pragma once
// Ray-block pairs without rays, for the stages that look at block ids alone: any number of blocks,
// no volume.

#include <cstdint>
#include <vector>

#include "bench/harness.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core::bench {

/// The pairs of one pass and the blocks their dual grids need.
struct BlockPairs {
  std::vector<uint> pair_block_ids;    ///< [num_pairs]
  std::vector<uint> needed_block_ids;  ///< ascending, each once
};

/// num_pairs pairs of num_visible blocks (one if `distribution` is kHot) in a cube of 2^key_bits
/// blocks (key_bits divisible by 3), each with all eight blocks of its dual grid. half 0 and 1 give
/// the same pattern in the lower and in the upper half of the cube: two sets with no block in
/// common.
BlockPairs make_block_pairs(Distribution distribution, std::size_t num_pairs,
                            std::size_t num_visible, std::uint32_t key_bits, std::uint32_t half);

/// Constants of a frame over a cube of 2^key_bits blocks; only the grid's are set.
FrameParams cube_params(std::uint32_t key_bits);

/// Counts of a pass in which every one of num_pairs rays asks for one block.
PassCounts pair_counts(std::size_t num_pairs, std::uint32_t pass);

}  // namespace isowave::core::bench
