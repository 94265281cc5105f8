#include "bench/harness.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <vector>

#include "bench/run_info.hpp"
#include "core/error.hpp"
#include "core/ocl/buffer.hpp"

namespace isowave::bench {

namespace {

using Clock = std::chrono::steady_clock;

Session *current_session = nullptr;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// The best of a few copies of 64 MiB.
double measure_copy_bandwidth(ocl::Device &device) {
  constexpr std::size_t kBytes = 64u << 20;
  constexpr int kRounds = 5;
  const ocl::Buffer<cl_uchar> source(device, "copy source", kBytes), target(device, "copy target", kBytes);
  double best = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kRounds; ++round) {
    device.finish();
    const auto begin = Clock::now();
    device.queue().enqueueCopyBuffer(source.mem(), target.mem(), 0, 0, kBytes);
    device.finish();
    best = std::min(best, seconds_since(begin));
  }
  return 2.0 * kBytes / best;
}

/// Difference of the quartiles in percent of the median.
double spread_percent(std::vector<double> seconds) {
  std::sort(seconds.begin(), seconds.end());
  const std::size_t last = seconds.size() - 1;
  return 100.0 * (seconds[3 * last / 4] - seconds[last / 4]) / median(seconds);
}

}  // namespace

Session::Session(const ocl::DeviceInfo &info, bool profiling)
    : device_(info, profiling), copy_bandwidth_(measure_copy_bandwidth(device_)) {
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
  for (auto _ : state) {
    prepare();
    device.finish();
    timer.collect();
    const auto begin = Clock::now();
    run();
    device.finish();
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
  state.counters["of_copy_%"] = 100.0 * work.bytes / median(timed) / session.copy_bandwidth();
}

benchmark::internal::Benchmark *stage_benchmark(const std::string &name,
                                                const std::function<void(benchmark::State &)> &body) {
  const auto guarded = [body](benchmark::State &state) {
    try {
      body(state);
    } catch (const std::exception &error) {
      Session::current().failed = true;
      Session::current().input_key.clear();
      state.SkipWithError(error.what());
    }
  };
  return benchmark::RegisterBenchmark(name.c_str(), guarded)->UseManualTime()->Unit(benchmark::kMillisecond);
}

}  // namespace isowave::bench
