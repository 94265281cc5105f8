#pragma once
// Milliseconds per pipeline stage, from OpenCL events. If a driver reports event times of 0 (Mesa
// rusticl 22.3), they come from the wall clock around a finish. Costs nothing when off.
//
//   { const auto stage = device.timer().stage("traverse");  traverse_kernel_(...); ... }
//   device.timer().collect()   // waits; name -> ms since the last collect()

#include <CL/opencl.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isowave::core::ocl {

enum class TimerSource { kOff, kEvents, kWallClock };

class StageTimer {
 public:
  class Stage {
   public:
    ~Stage();
    Stage(const Stage &) = delete;
    Stage &operator=(const Stage &) = delete;

   private:
    friend class StageTimer;
    Stage(StageTimer &timer, std::string_view name);
    StageTimer &timer_;
    std::string outer_;
  };

  /// Launches made while the returned object lives are booked under `name`. Nests: the innermost
  /// name counts. With kWallClock both ends wait for the queue, and what is launched outside every
  /// stage is not booked; with kEvents that is booked under "other".
  [[nodiscard]] Stage stage(std::string_view name) { return Stage(*this, name); }

  TimerSource source() const { return source_; }
  /// Waits for the queue; milliseconds per stage since the last call. Empty when off. Call it now
  /// and then: every launch keeps an event until then.
  ///
  /// Throws  Error: the device failed
  std::map<std::string, double> collect();

  /// For Kernel and Buffer: the event a launch must fill, or nullptr when none is wanted. Counts
  /// the launch.
  cl::Event *next_event();
  /// Launches, fills and transfers enqueued so far, timed or not.
  std::uint64_t num_commands() const { return num_commands_; }

 private:
  friend class Device;
  void start(TimerSource source, cl::CommandQueue queue);
  /// kWallClock: waits for the queue and books the time since the last segment under the innermost
  /// stage.
  void finish_segment();

  TimerSource source_ = TimerSource::kOff;
  cl::CommandQueue queue_;
  std::string current_ = "other";
  int depth_ = 0;  ///< stages alive
  std::uint64_t num_commands_ = 0;
  std::chrono::steady_clock::time_point segment_start_;
  std::vector<std::pair<std::string, cl::Event>> events_;
  std::map<std::string, double> milliseconds_;
};

}  // namespace isowave::core::ocl
