#include "core/render/time_budget.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/base/error.hpp"

namespace isowave {

namespace {

/// Pixels of a step for each of the step before.
constexpr double kGrowth = 4;

void add(FrameStats &sum, FrameStats step) {
  step.passes.insert(step.passes.begin(), sum.passes.begin(), sum.passes.end());
  step.uploaded_blocks += sum.uploaded_blocks;
  step.uploaded_bytes += sum.uploaded_bytes;
  sum = std::move(step);
}

}  // namespace

void check_time_budget(double budget_ms) {
  if (!(budget_ms > 0) || !std::isfinite(budget_ms))
    throw Error("no picture can be drawn in {} ms: give more than 0", budget_ms);
}

double TimedFrames::steady_clock_ms() {
  return std::chrono::duration<double, std::milli>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

TimedFrames::TimedFrames(Renderer &renderer, Clock now)
    : renderer_(renderer), now_(std::move(now)) {
  if (!renderer.options().with_kept_picture)
    throw Error("no frame can be drawn within a time: the renderer was made to keep no picture");
}

TimedFrame TimedFrames::render(const FrameRequest &request, double budget_ms) {
  check(request, budget_ms);
  const double begin = now_();
  TimedFrame frame;
  std::size_t step = kNumSteps - 1;
  for (;;) {
    const StepTimes times = draw(request, step, begin + budget_ms, frame);
    if (step == 0) break;
    renderer_.keep_picture();
    if (frame.steps.back().cancelled) break;
    const std::size_t next = next_step(step, times, begin + budget_ms - times.end);
    if (next == step) break;
    step = next;
  }
  if (step != 0) renderer_.enlarge_kept(request);
  frame.stats.total_ms = now_() - begin;
  return frame;
}

void TimedFrames::check(const FrameRequest &request, double budget_ms) const {
  check_time_budget(budget_ms);
  renderer_.check(request);
  if (request.on_pass)
    throw Error("a frame within a time stops by the clock: leave out on_pass, or the time");
  const ImageSize half = halved(request.size, 1), largest = halved(renderer_.options().max_size, 1);
  if (half.num_rays() > largest.num_rays()) {
    throw Error("half of {}x{} pixels cannot be kept: the renderer keeps a picture of {} rays",
                request.size.width, request.size.height, largest.num_rays());
  }
}

/// The request with fewer rays, and voxels that are as far apart in pixels of the full size, but at
/// least one of its own pixels.
FrameRequest TimedFrames::of_step(FrameRequest request, std::size_t step) const {
  if (step == 0) return request;
  const double scale =
      std::ldexp(1.0, static_cast<int>(step)) / request.size.samples;  // of its pixels
  request.voxel_pixels =
      renderer_.options().with_levels ? std::max(1.0, request.voxel_pixels / scale) : 0.0;
  request.size = halved(request.size, static_cast<unsigned>(step));
  return request;
}

/// Adds the step to the frame. The first is drawn whole, others until it is end_ms, and are then
/// filled from what was kept.
TimedFrames::StepTimes TimedFrames::draw(const FrameRequest &request, std::size_t step,
                                         double end_ms, TimedFrame &frame) {
  FrameRequest drawn = of_step(request, step);
  const double begin = now_();
  double pass_begin = begin, first_pass_ms = 0;
  const bool may_be_cancelled = !frame.steps.empty();
  // Further passes have fewer rays, so the next one takes no longer than the last, mostly.
  drawn.on_pass = [&](const PassStats &) {
    const double now = now_(), pass_ms = now - pass_begin;
    if (first_pass_ms == 0) first_pass_ms = pass_ms;
    pass_begin = now;
    return !may_be_cancelled || now + pass_ms <= end_ms;
  };
  const FrameStats stats = renderer_.render(drawn);
  const double end = now_(), step_ms = end - begin;
  frame.steps.push_back({drawn.size, drawn.voxel_pixels, step_ms,
                         stats.passes.back().completed_percent, stats.cancelled});
  add(frame.stats, stats);
  frame.complete = !stats.cancelled && step == 0;
  last_ms_[step] = stats.cancelled ? 2 * step_ms : step_ms;
  if (stats.cancelled) renderer_.fill_from_kept();
  return {step_ms, first_pass_ms, end};
}

/// After a step that took so long: the step to draw in left_ms, or `step` where there is no time.
std::size_t TimedFrames::next_step(std::size_t step, const StepTimes &times, double left_ms) const {
  std::size_t next = step;
  double expected = times.step_ms;
  for (std::size_t finer = step; finer-- > 0;) {
    expected = last_ms_[finer] > 0 ? last_ms_[finer] : kGrowth * expected;
    if (expected <= left_ms) next = finer;
  }
  // Part of a better picture is better than none.
  if (next == step && step > 0 && kGrowth * times.first_pass_ms <= left_ms) next = step - 1;
  return next;
}

}  // namespace isowave
