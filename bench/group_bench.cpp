// Gathering a pass's ray-block pairs by block: group.cl, with its compactions and its sort. slot_bits is the
// length of the sort's keys: the cache has 2^slot_bits slots, and 1/16 of them hold visible blocks.

#include <algorithm>
#include <unordered_map>

#include "bench/block_pairs.hpp"
#include "core/group.hpp"

namespace isowave::bench {
namespace {

constexpr std::uint32_t kKeyBits = 18;  // blocks of 256^3 voxels

struct GroupInput {
  GroupInput(ocl::Device &device, std::int64_t num_pairs, std::int64_t slot_bits, Distribution distribution)
      : num_slots(1u << slot_bits),
        pairs(make_block_pairs(distribution, num_pairs, num_slots / 16, kKeyBits, 0)),
        rays(device, num_pairs),
        compaction(device, num_pairs, kGroupSize),
        cache(device, 1u << kKeyBits, num_slots, num_pairs, kGroupSize),
        group(device, num_pairs, num_slots, kGroupSize) {
    const FrameParams params = cube_params(kKeyBits);
    const PassCounts counts = pair_counts(num_pairs, ISO_AGE_BUCKETS + 1);
    rays.frame.write({&params, 1});
    rays.counts.write({&counts, 1});
    rays.pair_block_ids.write(pairs.pair_block_ids);
    cache.request(rays);
    cache.assign_slots(rays);
    run();
    verify();
  }
  void run() { group(cache, rays, compaction); }

  /// Pairs by slot, in their old order within a slot; where each block's pairs begin.
  void verify() const {
    const PassCounts counts = rays.counts.read()[0];
    const std::vector<uint> slot_blocks = cache.slot_block_ids.read();
    std::unordered_map<uint, uint> slot_of;
    for (uint slot = 0; slot < slot_blocks.size(); ++slot) slot_of[slot_blocks[slot]] = slot;
    std::vector<uint> keys, order(pairs.pair_block_ids.size()), offsets;
    for (const uint block_id : pairs.pair_block_ids) keys.push_back(slot_of.at(block_id));
    for (uint pair = 0; pair < order.size(); ++pair) order[pair] = pair;
    std::stable_sort(order.begin(), order.end(), [&keys](uint a, uint b) { return keys[a] < keys[b]; });
    for (uint i = 0; i < order.size(); ++i) {
      if (i == 0 || keys[order[i]] != keys[order[i - 1]]) offsets.push_back(i);
    }
    check(counts.granted_count == order.size(), "pairs that can be intersected");
    check(group.groups().pair_ids.read() == order, "order of the grouped pairs");
    check(counts.visible_count == offsets.size(), "number of visible blocks");
    std::vector<uint> got(offsets.size());
    group.groups().block_ray_offsets.read(got);
    check(got == offsets, "first pair of each block");
  }

  std::uint32_t num_slots;
  BlockPairs pairs;
  Wavefront rays;
  Compaction compaction;
  BlockCache cache;
  Group group;
};

void group_pairs(benchmark::State &state, Distribution distribution) {
  const std::int64_t num_pairs = pixels_of_width(state.range(0));
  auto &in = input<GroupInput>(num_pairs, state.range(1), distribution);
  const auto pairs = static_cast<double>(num_pairs);
  measure(
      state, {pairs, 12 * pairs}, [] {}, [&] { in.run(); });
}

const bool kRegistered = [] {
  for (const Distribution distribution : kDistributions) {
    stage_benchmark(fmt::format("group/{}", to_string(distribution)),
                    [=](benchmark::State &state) { group_pairs(state, distribution); })
        ->ArgNames({"width", "slot_bits"})
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {14, 18}});
  }
  return true;
}();

}  // namespace
}  // namespace isowave::bench
