// The cost of a launch: an empty kernel, queued and with a wait after each launch, profiling off
// and on. Wall clock.

#include <chrono>

#include "bench/harness.hpp"
#include "kernels/launch_probe.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core::bench {
namespace {

using Clock = std::chrono::steady_clock;

/// Launches per wait: enough that the wait does not count.
constexpr int kBatch = 1000;

/// Profiling belongs to the queue, so each has a device of its own.
struct LaunchInput {
  LaunchInput(ocl::Device &session_device, bool profiling)
      : device(session_device.info(), profiling), empty(device), counts(device, "counts", 1) {
    empty({1, 64});
    device.finish();
  }

  ocl::Device device;
  ocl::Kernel<kernels::launch_empty> empty;
  ocl::Buffer<PassCounts> counts;
};

void queued_launch(benchmark::State &state) {
  auto &in = input<LaunchInput>(state.range(0) != 0);
  for (auto _ : state) {
    const auto begin = Clock::now();
    for (int i = 0; i < kBatch; ++i) in.empty({1, 64});
    in.device.finish();
    state.SetIterationTime(std::chrono::duration<double>(Clock::now() - begin).count());
    in.device.timer().collect();
  }
  state.SetItemsProcessed(state.iterations() * kBatch);
}

/// Launch, then read one struct back and wait: what a host that looks at every pass pays.
void launch_and_read_back(benchmark::State &state) {
  auto &in = input<LaunchInput>(false);
  std::vector<PassCounts> host(1);
  for (auto _ : state) {
    const auto begin = Clock::now();
    in.empty({1, 64});
    in.counts.read(host);
    state.SetIterationTime(std::chrono::duration<double>(Clock::now() - begin).count());
    benchmark::DoNotOptimize(host.data());
  }
  state.SetItemsProcessed(state.iterations());
}

const bool kRegistered = [] {
  stage_benchmark("ocl_launch/queued_1000", queued_launch)->ArgName("profiling")->Arg(0)->Arg(1);
  stage_benchmark("ocl_launch/read_back", launch_and_read_back)->Unit(benchmark::kMicrosecond);
  return true;
}();

}  // namespace
}  // namespace isowave::core::bench
