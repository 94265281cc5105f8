#include "bench/harness.hpp"

#include <chrono>
#include <limits>
#include <vector>

#include "bench/run_info.hpp"
#include "core/base/error.hpp"
#include "kernels/launch_probe.hpp"

namespace isowave::core::bench {

namespace {

using Clock = std::chrono::steady_clock;

Session *current_session = nullptr;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Seconds of `run`, by events or else by the wall clock.
double seconds_of(ocl::Device &device, const Step &run) {
  device.finish();
  device.timer().collect();
  const auto begin = Clock::now();
  run();
  device.finish();
  const double wall_seconds = seconds_since(begin);
  if (device.timer().source() != ocl::TimerSource::kEvents) return wall_seconds;
  double event_ms = 0;
  for (const auto &[stage, ms] : device.timer().collect()) event_ms += ms;
  return 1e-3 * event_ms;
}

double best_seconds(ocl::Device &device, const Step &run) {
  constexpr int kRounds = 5;
  double best = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kRounds; ++round) best = std::min(best, seconds_of(device, run));
  return best;
}

Ceiling measure_ceiling(ocl::Device &device) {
  constexpr std::uint64_t kCopyBytes = 256u << 20;
  constexpr int kLaunches = 200;
  const std::uint64_t bytes = std::min(kCopyBytes, device.capabilities().largest_allocation / 4);
  const auto count = static_cast<uint>(bytes / sizeof(uint));
  const ocl::Buffer<uint> source(device, "copy source", count);
  ocl::Buffer<uint> target(device, "copy target", count);
  ocl::Kernel<kernels::scale_values> scale(device);
  ocl::Kernel<kernels::launch_empty> empty(device);
  const ocl::Range range = ocl::Range::strided(count, 256, device);
  const double copy = best_seconds(device, [&] {
    device.queue().enqueueCopyBuffer(source.mem(), target.mem(), 0, 0, bytes, nullptr,
                                     device.timer().next_event());
  });
  const double kernel = best_seconds(device, [&] { scale(range, source, count, 1, target); });
  const double launches = best_seconds(device, [&] {
    for (int i = 0; i < kLaunches; ++i) empty({1, 64});
  });
  return {2.0 * static_cast<double>(bytes) / std::min(copy, kernel), launches / kLaunches};
}

/// Difference of the quartiles in percent of the median.
double spread_percent(std::vector<double> seconds) {
  std::sort(seconds.begin(), seconds.end());
  const std::size_t last = seconds.size() - 1;
  return 100.0 * (seconds[3 * last / 4] - seconds[last / 4]) / median(seconds);
}

}  // namespace

Session::Session(const ocl::DeviceInfo &info, bool profiling)
    : device_(info, profiling), ceiling_(measure_ceiling(device_)) {
  current_session = this;
}

Session::~Session() {
  current_session = nullptr;
}

Session &Session::current() {
  if (!current_session) throw std::logic_error("no benchmark session is open");
  return *current_session;
}

std::string to_string(Distribution distribution) {
  switch (distribution) {
    case Distribution::kUniform:
      return "uniform";
    case Distribution::kHot:
      return "hot";
    case Distribution::kSorted:
      return "sorted";
  }
  return "";
}

void check(bool holds, const std::string &what) {
  if (!holds) throw Error("wrong result: {}", what);
}

void measure(benchmark::State &state, const Work &work, const Step &prepare, const Step &run) {
  Session &session = Session::current();
  ocl::Device &device = session.device();
  ocl::StageTimer &timer = device.timer();
  const bool has_events = timer.source() == ocl::TimerSource::kEvents;
  std::vector<double> wall_seconds, event_seconds;
  std::uint64_t launches = 0;
  for (auto _ : state) {
    prepare();
    device.finish();
    timer.collect();
    const std::uint64_t commands_before = timer.num_commands();
    const auto begin = Clock::now();
    run();
    device.finish();
    launches = timer.num_commands() - commands_before;
    wall_seconds.push_back(seconds_since(begin));
    double event_ms = 0;
    for (const auto &[stage, ms] : timer.collect()) event_ms += ms;
    event_seconds.push_back(event_ms * 1e-3);
    state.SetIterationTime(has_events ? event_seconds.back() : wall_seconds.back());
  }
  const std::vector<double> &timed = has_events ? event_seconds : wall_seconds;
  if (timed.empty()) return;
  const double iterations = static_cast<double>(state.iterations());
  state.SetItemsProcessed(static_cast<std::int64_t>(work.items * iterations));
  state.SetBytesProcessed(static_cast<std::int64_t>(work.bytes * iterations));
  state.counters["wall_ms"] = 1e3 * median(wall_seconds);
  if (has_events) state.counters["event_ms"] = 1e3 * median(event_seconds);
  state.counters["spread_%"] = spread_percent(timed);
  const double ceiling_seconds =
      session.ceiling().seconds(work.bytes, static_cast<double>(launches));
  state.counters["launches"] = static_cast<double>(launches);
  state.counters["ceiling_ms"] = 1e3 * ceiling_seconds;
  state.counters["of_ceiling_%"] = 100.0 * ceiling_seconds / median(timed);
}

benchmark::internal::Benchmark *stage_benchmark(
    const std::string &name, const std::function<void(benchmark::State &)> &body) {
  const auto guarded = [body](benchmark::State &state) {
    try {
      body(state);
    } catch (const std::exception &error) {
      Session::current().failed = true;
      Session::current().input_key.clear();
      state.SkipWithError(error.what());
    }
  };
  return benchmark::RegisterBenchmark(name.c_str(), guarded)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

}  // namespace isowave::core::bench
