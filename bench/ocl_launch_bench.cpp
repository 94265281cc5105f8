// The cost of launching on a device: an empty kernel, queued and with a wait after each launch, timer off and
// on. The device is the default one or ISOWAVE_DEVICE's; its name stands in the label.

#include <benchmark/benchmark.h>

#include <vector>

#include "core/ocl/kernel.hpp"
#include "kernels_cl/shared_types.h"

namespace isowave {
namespace {

/// Launches per wait: enough that the wait does not count.
constexpr int kBatch = 1000;

void label(benchmark::State &state, ocl::Device &device) {
  const char *source = device.timer().source() == ocl::TimerSource::kOff ? "timer off" : "timer on";
  state.SetLabel(device.info().name + ", " + source);
}

void BM_QueuedLaunch(benchmark::State &state) {
  ocl::Device device(ocl::choose_device(), state.range(0) != 0);
  ocl::Kernel<> empty(device, "launch_probe", "launch_empty");
  empty({1, 64});
  device.finish();
  for (auto _ : state) {
    for (int i = 0; i < kBatch; ++i) empty({1, 64});
    device.finish();
    state.PauseTiming();
    device.timer().collect();
    state.ResumeTiming();
  }
  state.SetItemsProcessed(state.iterations() * kBatch);
  label(state, device);
}
BENCHMARK(BM_QueuedLaunch)
    ->ArgName("profiling")
    ->Arg(0)
    ->Arg(1)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

/// Launch, then read one struct back and wait: what a host that looks at every pass pays.
void BM_LaunchAndReadBack(benchmark::State &state) {
  ocl::Device device(ocl::choose_device());
  ocl::Kernel<> empty(device, "launch_probe", "launch_empty");
  const ocl::Buffer<PassCounts> counts(device, "counts", 1);
  std::vector<PassCounts> host(1);
  for (auto _ : state) {
    empty({1, 64});
    counts.read(host);
    benchmark::DoNotOptimize(host.data());
  }
  label(state, device);
}
BENCHMARK(BM_LaunchAndReadBack)->UseRealTime()->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace isowave
