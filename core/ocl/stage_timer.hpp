#pragma once
// Milliseconds per pipeline stage, from OpenCL events; where a driver reports event times of 0 (Mesa rusticl 22.3), from
// the wall clock around a finish. Costs nothing when off.
//
//   { const auto stage = device.timer().stage("traverse");  traverse_kernel_(...); ... }
//   device.timer().collect()   // waits; name -> ms since the last collect()

#include <CL/opencl.hpp>
#include <chrono>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isowave::ocl {

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
    std::chrono::steady_clock::time_point start_;
  };

  /// Launches made while the returned object lives are booked under `name`. Nests: the innermost name counts.
  [[nodiscard]] Stage stage(std::string_view name) { return Stage(*this, name); }

  TimerSource source() const { return source_; }
  /// Waits for the queue; milliseconds per stage since the last call. Empty when off.
  std::map<std::string, double> collect();

  /// For Kernel and Buffer: the event a launch must fill, or nullptr when none is wanted.
  cl::Event *next_event();

 private:
  friend class Device;
  void start(TimerSource source, cl::CommandQueue queue);

  TimerSource source_ = TimerSource::kOff;
  cl::CommandQueue queue_;
  std::string current_ = "other";
  std::vector<std::pair<std::string, cl::Event>> events_;
  std::map<std::string, double> milliseconds_;
};

}  // namespace isowave::ocl
