// Exclusive prefix sum and compaction: scan.cl.

#include <algorithm>
#include <numeric>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/paper/scan.hpp"

namespace isowave::core::bench {
namespace {

/// A table such as the stages scan: one entry per tile of a compaction.
struct ScanInput {
  ScanInput(ocl::Device &device, std::int64_t entries)
      : scan(device, kGroupSize), counts(device, "counts", 1), values(device, "values", entries) {
    Random random;
    for (std::int64_t i = 0; i < entries; ++i) host.push_back(random.below(10));
    PassCounts start{};
    start.ray_count = static_cast<uint>(entries);
    counts.write({&start, 1});
    reset();
    run();
    std::vector<uint> expected(host.size());
    std::exclusive_scan(host.begin(), host.end(), expected.begin(), 0u);
    check(values.read() == expected, "exclusive scan");
    check(counts.read()[0].hit_count == expected.back() + host.back(), "total of the scan");
  }
  void reset() { values.write(host); }
  void run() { scan(values, counts, ISO_COUNT_FIELD(ray_count), 1, ISO_COUNT_FIELD(hit_count)); }

  std::vector<uint> host;
  ExclusiveScan scan;
  CountsBuffer counts;
  ocl::Buffer<uint> values;
};

void exclusive_scan(benchmark::State &state) {
  auto &in = input<ScanInput>(state.range(0));
  const auto entries = static_cast<double>(state.range(0));
  measure(
      state, {entries, 8 * entries}, [&] { in.reset(); }, [&] { in.run(); });
}

/// Half of the entries are kept: any (uniform), the first half (sorted); or one tile's (hot).
struct CompactionInput {
  CompactionInput(ocl::Device &device, std::int64_t entries, Distribution distribution)
      : compaction(device, entries, kGroupSize),
        counts(device, "counts", 1),
        mask(device, "mask", entries),
        values(device, "values", entries),
        out(device, "kept", entries) {
    Random random;
    std::vector<uint> kept(entries, 0), numbers(entries);
    for (uint &keep : kept) keep = distribution == Distribution::kUniform ? random.below(2) : 0;
    if (distribution == Distribution::kSorted) std::fill_n(kept.begin(), entries / 2, 1);
    if (distribution == Distribution::kHot) {
      std::fill_n(kept.begin() + entries / 2, kGroupSize * ISO_SCAN_ITEMS, 1);
    }
    for (uint &number : numbers) number = random.below(1u << 31);
    mask.write(kept);
    values.write(numbers);
    PassCounts start{};
    start.ray_count = static_cast<uint>(entries);
    counts.write({&start, 1});

    std::vector<uint> expected;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      if (kept[i]) expected.push_back(numbers[i]);
    }
    num_kept = expected.size();
    run();
    std::vector<uint> got(counts.read()[0].hit_count);
    out.read(got);
    check(got == expected, "kept values");
  }
  void run() {
    compaction(mask, values, counts, ISO_COUNT_FIELD(ray_count), out, ISO_COUNT_FIELD(hit_count));
  }

  std::size_t num_kept = 0;
  Compaction compaction;
  CountsBuffer counts;
  ocl::Buffer<uint> mask, values, out;
};

void compact(benchmark::State &state, Distribution distribution) {
  const std::int64_t entries = pixels_of_width(state.range(0));
  auto &in = input<CompactionInput>(entries, distribution);
  const double bytes = 4.0 * static_cast<double>(entries) + 8.0 * double(in.num_kept);
  measure(
      state, {static_cast<double>(entries), bytes}, [] {}, [&] { in.run(); });
}

const bool kRegistered = [] {
  stage_benchmark("scan/exclusive", exclusive_scan)
      ->ArgName("entries")
      ->ArgsProduct({{640 * 360 / 512, 1280 * 720 / 512, 3840 * 2160 / 512}})
      ->Iterations(1000);  // microseconds each: --benchmark_min_time would ask for far more
  for (const Distribution distribution : kDistributions) {
    stage_benchmark(fmt::format("scan/compact_values/{}", to_string(distribution)),
                    [=](benchmark::State &state) { compact(state, distribution); })
        ->ArgName("width")
        ->ArgsProduct({{kWidths.begin(), kWidths.end()}})
        ->Arg(kLargeWidth);
  }
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
