// isowave_bench: every stage of the pipeline alone, on one device. The options that are not ours
// are Google Benchmark's: --benchmark_filter=REGEX picks stages, --benchmark_out=FILE writes JSON.
// A default run is for looking around. For numbers to quote or to compare (tools/compare-bench),
// add --benchmark_min_time=1 or --benchmark_repetitions=9.

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "bench/harness.hpp"
#include "bench/run_info.hpp"
#include "tools/isowave/program.hpp"

namespace {

/// Short, so that a default run of everything takes minutes on a CPU.
constexpr const char *kMinTime = "--benchmark_min_time=0.05";

int run_benchmarks(const std::string &device, bool profiling, std::vector<std::string> arguments) {
  std::vector<char *> argv;
  std::transform(arguments.begin(), arguments.end(), std::back_inserter(argv),
                 [](std::string &argument) { return argument.data(); });
  int argc = static_cast<int>(argv.size());
  benchmark::Initialize(&argc, argv.data());
  if (benchmark::ReportUnrecognizedArguments(argc, argv.data())) return 1;

  isowave::core::bench::Session session(isowave::core::ocl::choose_device(device), profiling);
  for (const auto &[name, value] : isowave::core::bench::run_info(session.device())) {
    benchmark::AddCustomContext(name, value);
  }
  const isowave::core::bench::Ceiling &ceiling = session.ceiling();
  benchmark::AddCustomContext("copy_GB_per_s",
                              fmt::format("{:.1f}", ceiling.bytes_per_second * 1e-9));
  benchmark::AddCustomContext("launch_us", fmt::format("{:.2f}", ceiling.launch_seconds * 1e6));
  const std::size_t num_run = benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return session.failed || num_run == 0 ? 1 : 0;
}

}  // namespace

int main(int argc, char **argv) {
  CLI::App app("Times every stage of isowave alone.", "isowave_bench");
  std::string device;
  bool no_events = false;
  app.add_option(
      "--device", device,
      "device: index, cpu, gpu, or a part of its name [ISOWAVE_DEVICE, or the first GPU]");
  app.add_flag("--no-events", no_events, "time with the wall clock: profiling slows launches down");
  app.allow_extras();
  app.footer("All other options are Google Benchmark's: see --benchmark_help.");
  app.callback([&] {
    std::vector<std::string> arguments = {argv[0], kMinTime};
    for (const std::string &extra : app.remaining()) {
      arguments.push_back(extra == "--benchmark_help" ? "--help" : extra);
    }
    if (run_benchmarks(device, !no_events, std::move(arguments)) != 0) throw CLI::RuntimeError(1);
  });
  return isowave::core::tools::run_program(app, argc, argv);
}
