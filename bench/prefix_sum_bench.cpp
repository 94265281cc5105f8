// Prefix sums of long tables: prefix_sum.cl, as many entries as an extracted surface has blocks.

#include <numeric>

#include "bench/harness.hpp"
#include "bench/scenes.hpp"
#include "core/stages/prefix_sum.hpp"

namespace isowave::core::bench {
namespace {

struct PrefixSumInput {
  PrefixSumInput(ocl::Device &device, std::int64_t entries)
      : count(static_cast<uint>(entries)),
        sum(device, count, kGroupSize),
        values(device, "values", std::size_t{count} + 1) {
    Random random;
    for (uint i = 0; i <= count; ++i) host.push_back(random.below(193));
    reset();
    run();
    std::vector<uint> expected(host.size());
    std::exclusive_scan(host.begin(), host.end(), expected.begin(), 0u);
    check(values.read() == expected, "prefix sums");
  }
  void reset() { values.write(host); }
  void run() { sum(values, count); }

  uint count;
  std::vector<uint> host;
  PrefixSum sum;
  ocl::Buffer<uint> values;
};

void prefix_sum(benchmark::State &state) {
  auto &in = input<PrefixSumInput>(state.range(0));
  const auto entries = static_cast<double>(state.range(0));
  measure(
      state, {entries, 12 * entries}, [&] { in.reset(); }, [&] { in.run(); });
}

const bool kRegistered = [] {
  stage_benchmark("prefix_sum", prefix_sum)
      ->ArgName("entries")
      ->ArgsProduct({{1 << 14, 1 << 17, 1 << 20, 1 << 23}});
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
