#include "bench/block_pairs.hpp"

#include <algorithm>

#include "bench/scenes.hpp"

namespace isowave::core::bench {

BlockPairs make_block_pairs(Distribution distribution, std::size_t num_pairs,
                            std::size_t num_visible, std::uint32_t key_bits, std::uint32_t half) {
  Random random;
  const std::uint32_t edge = 1u << (key_bits / 3);
  const auto block_id = [edge](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return x + edge * (y + edge * z);
  };
  BlockPairs pairs;
  std::vector<uint> visible(distribution == Distribution::kHot ? 1 : num_visible);
  for (uint &id :
       visible) {  // never in the last layer of a half, so that the dual grid stays inside
    const std::uint32_t x = random.below(edge - 1), y = random.below(edge - 1),
                        z = random.below(edge / 2 - 1) + half * edge / 2;
    id = block_id(x, y, z);
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      pairs.needed_block_ids.push_back(
          block_id(x + (corner & 1u), y + (corner >> 1 & 1u), z + (corner >> 2)));
    }
  }
  std::sort(pairs.needed_block_ids.begin(), pairs.needed_block_ids.end());
  pairs.needed_block_ids.erase(
      std::unique(pairs.needed_block_ids.begin(), pairs.needed_block_ids.end()),
      pairs.needed_block_ids.end());
  for (std::size_t pair = 0; pair < num_pairs;
       ++pair) {  // every visible block once, then at random
    pairs.pair_block_ids.push_back(pair < visible.size() ? visible[pair]
                                                         : visible[random.below(visible.size())]);
  }
  if (distribution == Distribution::kSorted) {
    std::sort(pairs.pair_block_ids.begin(), pairs.pair_block_ids.end());
  } else {
    random.shuffle(pairs.pair_block_ids);
  }
  return pairs;
}

FrameParams cube_params(std::uint32_t key_bits) {
  const std::uint32_t edge = 1u << (key_bits / 3);
  FrameParams params{};
  params.grid.blocks_x = params.grid.blocks_y = params.grid.blocks_z = edge;
  params.grid.dims_x = params.grid.dims_y = params.grid.dims_z = 4 * edge;
  return params;
}

PassCounts pair_counts(std::size_t num_pairs, std::uint32_t pass) {
  PassCounts counts{};
  counts.ray_count = static_cast<uint>(num_pairs);
  counts.pass = counts.frame_pass = pass;
  counts.active_count = counts.window_count = counts.pair_slot_count = counts.pair_count =
      counts.ray_count;
  counts.spec_count = 1;
  return counts;
}

}  // namespace isowave::core::bench
