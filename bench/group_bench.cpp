// Gathering a pass's ray-block pairs by block, by radix sort and by counting: group.cl, with its
// sort. The cache has 2^slot_bits slots (the length of the radix sort's keys); the pairs are those
// of 2^visible_bits blocks, or of one (hot).

#include <algorithm>
#include <unordered_map>

#include "bench/block_pairs.hpp"
#include "core/paper/group.hpp"

namespace isowave::core::bench {
namespace {

constexpr std::uint32_t kKeyBits = 18;  // blocks of 256^3 voxels

struct GroupInput {
  GroupInput(ocl::Device &device, std::uint64_t num_pairs, std::int64_t slot_bits,
             std::int64_t visible_bits, Distribution distribution, Grouping how)
      : num_slots(1u << slot_bits),
        pairs(
            make_block_pairs(distribution, num_pairs, std::size_t{1} << visible_bits, kKeyBits, 0)),
        rays(device, {num_pairs}),
        cache(device, BlockCache::limits_for(cube_params(kKeyBits).grid, num_slots, num_pairs),
              kGroupSize),
        group(device, {num_pairs, num_slots, kGroupSize, how}) {
    FrameParams params = cube_params(kKeyBits);
    params.schedule.cache_slots = cache.num_slots;
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
    const PassCounts counts = pair_counts(rays.num_rays, 1);
    rays.counts.write({&counts, 1});
  }
  void run() { group(cache, rays); }

  /// The pairs of each visible block lie together, and no others.
  void verify() const {
    const PassCounts counts = rays.counts.read()[0];
    std::unordered_map<uint, std::vector<uint>> expected;
    for (uint pair = 0; pair < pairs.pair_block_ids.size(); ++pair)
      expected[pairs.pair_block_ids[pair]].push_back(pair);
    check(counts.granted_count == pairs.pair_block_ids.size(), "pairs that can be intersected");
    check(counts.visible_count == expected.size(), "number of visible blocks");
    std::vector<uint> got = group.groups().pair_ids.read();
    std::vector<BlockRays> block_rays(counts.visible_count);
    group.groups().block_rays.read(block_rays);
    for (const auto [begin, end] : block_rays) {
      check(begin < end && end <= got.size(), "places of a block's pairs");
      std::sort(got.begin() + begin, got.begin() + end);
      const std::vector<uint> &own = expected[pairs.pair_block_ids.at(got[begin])];
      check(std::equal(got.begin() + begin, got.begin() + end, own.begin(), own.end()),
            "pairs of a block");
    }
  }

  std::uint32_t num_slots;
  BlockPairs pairs;
  Wavefront rays;
  BlockCache cache;
  Group group;
};

void group_pairs(benchmark::State &state, Grouping grouping, Distribution distribution) {
  const std::int64_t num_pairs = pixels_of_width(state.range(0));
  auto &in = input<GroupInput>(num_pairs, state.range(1), state.range(2), distribution, grouping);
  const auto pairs = static_cast<double>(num_pairs);
  // Read: block ids. Written: pair ids.
  measure(
      state, {pairs, 8 * pairs}, [&] { in.open_pass(); }, [&] { in.run(); });
}

const bool kRegistered = [] {
  for (const Distribution distribution : kDistributions) {
    for (const Grouping grouping : {Grouping::kRadix, Grouping::kCounting}) {
      auto *benchmark = stage_benchmark(
          fmt::format("group/{}/{}", to_string(grouping), to_string(distribution)),
          [=](benchmark::State &state) { group_pairs(state, grouping, distribution); });
      benchmark->ArgNames({"width", "slot_bits", "visible_bits"});
      for (const std::int64_t width : kWidths)
        benchmark->Args({width, 14, 10})->Args({width, 18, 14});
      benchmark->Args({kSortWidth, 18, 14});
      if (distribution == Distribution::kHot) continue;
      benchmark->Args({kWidths.front(), 18, 16});  // few rays a block: most keys are distinct
      benchmark->Args({kLargeWidth, 18, 14});
    }
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
