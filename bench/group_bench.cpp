// Gathering a pass's ray-block pairs by block, by radix sort and by counting: group.cl, with its compactions and its
// sort. The cache has 2^slot_bits slots (the length of the radix sort's keys); the pairs are those of 2^visible_bits
// blocks, or of one (hot).

#include <algorithm>
#include <unordered_map>

#include "bench/block_pairs.hpp"
#include "core/group.hpp"

namespace isowave::bench {
namespace {

constexpr std::uint32_t kKeyBits = 18;  // blocks of 256^3 voxels

struct GroupInput {
  GroupInput(ocl::Device &device, std::int64_t num_pairs, std::int64_t slot_bits, std::int64_t visible_bits,
             Distribution distribution, Grouping how)
      : num_slots(1u << slot_bits),
        grouping(how),
        pairs(make_block_pairs(distribution, num_pairs, std::size_t{1} << visible_bits, kKeyBits, 0)),
        rays(device, num_pairs),
        compaction(device, num_pairs, kGroupSize),
        cache(device, cube_params(kKeyBits), num_slots, num_pairs, kGroupSize),
        group(device, num_pairs, num_slots, kGroupSize, grouping) {
    FrameParams params = cube_params(kKeyBits);
    params.table_groups = cache.table_groups;
    rays.frame = params;
    rays.pair_block_ids.write(pairs.pair_block_ids);
    open_pass();
    cache.request(rays);
    cache.evict(rays.counts, rays);
    cache.assign(rays.counts, rays);
    for (int pass = 0; pass < 2; ++pass) {  // the second starts from what the first leaves behind
      open_pass();
      run();
      verify();
    }
  }
  void open_pass() {
    const PassCounts counts = pair_counts(rays.num_pixels, ISO_AGE_BUCKETS + 1);
    rays.counts.write({&counts, 1});
  }
  void run() { group(cache, rays, compaction); }

  /// Pairs by slot, by radix sort in their old order within a slot; where each block's pairs begin.
  void verify() const {
    const PassCounts counts = rays.counts.read()[0];
    const std::vector<uint> slot_blocks = cache.slot_block_ids.read();
    std::unordered_map<uint, uint> slot_of;
    for (uint slot = 0; slot < slot_blocks.size(); ++slot) slot_of[slot_blocks[slot]] = slot;
    std::vector<uint> keys, order(pairs.pair_block_ids.size()), first_of_slot(num_slots, ISO_INVALID_ID);
    for (const uint block_id : pairs.pair_block_ids) keys.push_back(slot_of.at(block_id));
    for (uint pair = 0; pair < order.size(); ++pair) order[pair] = pair;
    std::stable_sort(order.begin(), order.end(), [&keys](uint a, uint b) { return keys[a] < keys[b]; });
    uint num_visible = 0;
    for (uint i = 0; i < order.size(); ++i) {
      if (i != 0 && keys[order[i]] == keys[order[i - 1]]) continue;
      first_of_slot[keys[order[i]]] = i;
      ++num_visible;
    }
    check(counts.granted_count == order.size(), "pairs that can be intersected");
    check(counts.visible_count == num_visible, "number of visible blocks");
    std::vector<uint> got = group.groups().pair_ids.read(), offsets(num_visible);
    const std::vector<uint> slots = group.groups().slots.read();
    group.groups().block_ray_offsets.read(offsets);
    if (grouping == Grouping::kRadix) check(got == order, "order of the grouped pairs");
    for (uint visible = 0; visible < num_visible; ++visible) {
      const uint begin = offsets[visible];
      const uint end = visible + 1 < num_visible ? offsets[visible + 1] : counts.granted_count;
      check(begin < end && end <= got.size(), "first pair of each block");
      std::sort(got.begin() + begin, got.begin() + end);
      const uint expected = first_of_slot[slots[begin]];
      check(expected + (end - begin) <= order.size() &&
                std::equal(got.begin() + begin, got.begin() + end, order.begin() + expected),
            "pairs of a block");
    }
  }

  std::uint32_t num_slots;
  Grouping grouping;
  BlockPairs pairs;
  Wavefront rays;
  Compaction compaction;
  BlockCache cache;
  Group group;
};

void group_pairs(benchmark::State &state, Grouping grouping, Distribution distribution) {
  const std::int64_t num_pairs = pixels_of_width(state.range(0));
  auto &in = input<GroupInput>(num_pairs, state.range(1), state.range(2), distribution, grouping);
  const auto pairs = static_cast<double>(num_pairs);
  // Read: block ids. Written: pair ids, slots, the cells of pair_hits.
  measure(
      state, {pairs, 16 * pairs}, [&] { in.open_pass(); }, [&] { in.run(); });
}

const bool kRegistered = [] {
  for (const Distribution distribution : kDistributions) {
    for (const Grouping grouping : {Grouping::kRadix, Grouping::kCounting}) {
      auto *benchmark =
          stage_benchmark(fmt::format("group/{}/{}", to_string(grouping), to_string(distribution)),
                          [=](benchmark::State &state) { group_pairs(state, grouping, distribution); });
      benchmark->ArgNames({"width", "slot_bits", "visible_bits"});
      for (const std::int64_t width : kWidths) benchmark->Args({width, 14, 10})->Args({width, 18, 14});
      benchmark->Args({kSortWidth, 18, 14});
      if (distribution == Distribution::kHot) continue;
      benchmark->Args({kWidths.front(), 18, 16});  // few rays a block: most keys are distinct
      benchmark->Args({kLargeWidth, 18, 14});
    }
  }
  return true;
}();

}  // namespace
}  // namespace isowave::bench
