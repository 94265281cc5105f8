#pragma once
// Code that the stage benchmarks share: the device, inputs that are made once, and the clock.
//
//   // makes and checks its input: not timed
//   struct SortInput { SortInput(ocl::Device &, std::int64_t pairs); ... };
//   void sort_pairs(benchmark::State &state) {
//     auto &in = input<SortInput>(state.range(0));
//     measure(state, {pairs, bytes}, [&] { in.reset(); }, [&] { in.sort(...); });
//   }
//   const bool kRegistered = (stage_benchmark("radix_sort", sort_pairs)->Arg(921600), true);

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <typeinfo>

#include "core/ocl/device.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave::core::bench {

/// Limits that no stage can beat, measured in the same run and by the clock that times the stages:
/// OpenCL events if the driver reports them, else the wall clock.
struct Ceiling {
  double bytes_per_second =
      0;  ///< read and written by a copy of 256 MiB: the better of command and kernel
  double launch_seconds = 0;  ///< an empty kernel

  /// Least time of a stage that moves `bytes` in `launches`. Data that a cache still holds may move
  /// faster.
  double seconds(double bytes, double launches) const {
    return std::max(bytes / bytes_per_second, launches * launch_seconds);
  }
};

/// Opens the device of all benchmarks; closes it, and frees the input kept, when it goes. One at a
/// time.
class Session {
 public:
  /// profiling: time with OpenCL events where the driver reports them, else with the wall clock.
  Session(const ocl::DeviceInfo &info, bool profiling);
  ~Session();
  Session(const Session &) = delete;
  Session &operator=(const Session &) = delete;

  /// The session at work.
  static Session &current();

  ocl::Device &device() { return device_; }
  const Ceiling &ceiling() const { return ceiling_; }

  /// Whether a benchmark failed: it threw, its check included.
  bool failed = false;
  /// The input made last, and what it was made of.
  std::string input_key;
  std::shared_ptr<void> input;

 private:
  ocl::Device device_;
  Ceiling ceiling_;
};

/// Work-items per group of the stages that take it: the renderer's default.
inline const std::uint32_t kGroupSize = RendererOptions{}.group_size;

/// How the keys, blocks or kept entries of an input lie.
enum class Distribution {
  kUniform,  ///< anywhere, in random order
  kHot,      ///< all in one place
  kSorted    ///< as kUniform, but in ascending order
};
inline constexpr std::array kDistributions = {Distribution::kUniform, Distribution::kHot,
                                              Distribution::kSorted};
/// "uniform", "hot", "sorted".
std::string to_string(Distribution distribution);

/// The image sizes that stages are swept over: 640x360 and 1280x720.
inline constexpr std::array<std::int64_t, 2> kWidths = {640, 1280};
/// Between them, for what sorts pairs: 896x504, 451,584 of them.
inline constexpr std::int64_t kSortWidth = 896;
/// Beyond them, for stages whose cost at that size is memory's: 3840x2160.
inline constexpr std::int64_t kLargeWidth = 3840;
inline ImageSize image_of_width(std::int64_t width) {
  return {static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(width * 9 / 16)};
}
inline std::int64_t pixels_of_width(std::int64_t width) {
  return static_cast<std::int64_t>(image_of_width(width).num_pixels());
}

/// T(device, args...), kept until the next different one is asked for: Google Benchmark calls a
/// benchmark several times to find how many iterations it needs. T's constructor also runs the
/// stage once and checks it.
template <class T, class... Args>
T &input(const Args &...args) {
  Session &session = Session::current();
  std::string key = typeid(T).name();
  ((key += fmt::format(" {}", static_cast<std::int64_t>(args))), ...);
  if (session.input_key != key) {
    session.input_key.clear();
    session.input.reset();  // before the next one takes its memory
    session.input = std::make_shared<T>(session.device(), args...);
    session.input_key = key;
  }
  return *static_cast<T *>(session.input.get());
}

/// Throws  Error naming `what` unless it holds
void check(bool holds, const std::string &what);

/// Whether both hold the same bytes: of floats, more than equality says.
template <class T>
bool same_bits(std::span<const T> a, std::span<const T> b) {
  return std::ranges::equal(std::as_bytes(a), std::as_bytes(b));
}

/// Counts of one run of a stage.
struct Work {
  double items = 0;
  double bytes = 0;  ///< that must be read or written at least, each once
};

using Step = std::function<void()>;

/// The benchmark loop: prepare, not timed; then run, timed from its first launch to the end of its
/// last. The time is that of the OpenCL events, or the wall clock's where there are none. Counters,
/// medians over the iterations: wall_ms, event_ms; spread_%: distance of the quartiles; launches;
/// ceiling_ms: Ceiling::seconds() of work and launches; of_ceiling_%: the fraction of the ceiling
/// that is reached, ceiling_ms of the time.
void measure(benchmark::State &state, const Work &work, const Step &prepare, const Step &run);

/// Registers `body` under `name`. What it throws becomes the error of that benchmark alone.
benchmark::internal::Benchmark *stage_benchmark(
    const std::string &name, const std::function<void(benchmark::State &)> &body);

}  // namespace isowave::core::bench
