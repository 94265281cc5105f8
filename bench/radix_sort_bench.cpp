// Sorting ray-block pairs by block: radix_sort.cl. key_bits 18 and 27 are block ids of 256^3 and
// 2048^3 voxels.

#include <algorithm>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/paper/radix_sort.hpp"

namespace isowave::core::bench {
namespace {

struct SortInput {
  SortInput(ocl::Device &device, std::int64_t num_pairs, std::int64_t key_bits,
            Distribution distribution)
      : bits(static_cast<uint>(key_bits)),
        host_keys(num_pairs),
        host_values(num_pairs),
        sort_pairs(device, num_pairs, kGroupSize),
        counts(device, "counts", 1),
        keys(device, "keys", num_pairs),
        values(device, "values", num_pairs) {
    Random random;
    const std::uint64_t bound = std::uint64_t{1} << bits;
    const uint hot_key = random.below(bound);
    for (uint &key : host_keys)
      key = distribution == Distribution::kHot ? hot_key : random.below(bound);
    if (distribution == Distribution::kSorted) std::sort(host_keys.begin(), host_keys.end());
    for (std::size_t i = 0; i < host_values.size(); ++i) host_values[i] = static_cast<uint>(i);
    PassCounts start{};
    start.ray_count = static_cast<uint>(num_pairs);
    counts.write({&start, 1});
    reset();
    run();
    verify();
  }
  void reset() {
    keys.write(host_keys);
    values.write(host_values);
  }
  void run() { sort_pairs(keys, values, counts, ISO_COUNT_FIELD(ray_count), bits); }
  void verify() {
    std::vector<uint> order = host_values;
    std::stable_sort(order.begin(), order.end(),
                     [this](uint a, uint b) { return host_keys[a] < host_keys[b]; });
    check(values.read() == order, "order of the sorted values");
    std::vector<uint> sorted_keys = host_keys;
    std::sort(sorted_keys.begin(), sorted_keys.end());
    check(keys.read() == sorted_keys, "sorted keys");
  }

  uint bits;
  std::vector<uint> host_keys, host_values;
  RadixSort sort_pairs;
  CountsBuffer counts;
  ocl::Buffer<uint> keys, values;
};

void sort_rays_by_block(benchmark::State &state, Distribution distribution) {
  const std::int64_t num_pairs = pixels_of_width(state.range(0));
  auto &in = input<SortInput>(num_pairs, state.range(1), distribution);
  const double pairs = static_cast<double>(num_pairs);
  measure(
      state, {pairs, 16 * pairs}, [&] { in.reset(); }, [&] { in.run(); });
}

const bool kRegistered = [] {
  for (const Distribution distribution : kDistributions) {
    stage_benchmark(fmt::format("radix_sort/{}", to_string(distribution)),
                    [=](benchmark::State &state) { sort_rays_by_block(state, distribution); })
        ->ArgNames({"width", "key_bits"})
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}, {18, 27}})
        ->Args({kSortWidth, 18})
        ->Args({kLargeWidth, 18});
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
