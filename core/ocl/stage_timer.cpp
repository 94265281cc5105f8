#include "core/ocl/stage_timer.hpp"

#include "core/base/error.hpp"
#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

StageTimer::Stage::Stage(StageTimer &timer, std::string_view name) : timer_(timer) {
  if (timer_.source_ == TimerSource::kOff) return;
  timer_.finish_segment();
  outer_ = std::exchange(timer_.current_, std::string(name));
  ++timer_.depth_;
}

StageTimer::Stage::~Stage() {
  if (timer_.source_ == TimerSource::kOff) return;
  try {
    timer_.finish_segment();
  } catch (...) {
    // A lost device or no memory: the next call on the queue says so, a destructor must not.
  }
  timer_.current_ = std::move(outer_);
  --timer_.depth_;
}

void StageTimer::start(TimerSource source, cl::CommandQueue queue) {
  source_ = source;
  queue_ = std::move(queue);
  segment_start_ = std::chrono::steady_clock::now();
}

void StageTimer::finish_segment() {
  if (source_ != TimerSource::kWallClock) return;
  queue_.finish();
  const auto now = std::chrono::steady_clock::now();
  // Outside every stage the clock would measure the host, so only launches inside one are booked.
  if (depth_ > 0) {
    milliseconds_[current_] +=
        std::chrono::duration<double, std::milli>(now - segment_start_).count();
  }
  segment_start_ = now;
}

cl::Event *StageTimer::next_event() {
  ++num_commands_;
  if (source_ != TimerSource::kEvents) return nullptr;
  return &events_.emplace_back(current_, cl::Event()).second;
}

std::map<std::string, double> StageTimer::collect() {
  if (source_ == TimerSource::kOff) return {};
  try {
    finish_segment();
    if (source_ == TimerSource::kEvents) queue_.finish();
    for (const auto &[name, event] : std::exchange(events_, {})) {
      if (event() == nullptr) continue;  // its launch failed
      const cl_ulong begin = event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
      const cl_ulong end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
      milliseconds_[name] += end > begin ? static_cast<double>(end - begin) * 1e-6 : 0.0;
    }
  } catch (const cl::Error &error) {
    throw Error("cannot read stage times: {}: {}", error.what(), error_name(error.err()));
  }
  return std::exchange(milliseconds_, {});
}

}  // namespace isowave::core::ocl
