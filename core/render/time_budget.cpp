#include "core/render/time_budget.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

/// Pixels of a step for each of the step before.
constexpr double kGrowth = 4;

void add(FrameStats &sum, FrameStats step) {
  step.passes.insert(step.passes.begin(), sum.passes.begin(), sum.passes.end());
  step.normals += sum.normals;
  step.ambient += sum.ambient;
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

TimedFrames::TimedFrames(Renderer &renderer, Clock now, Draw draw)
    : renderer_(renderer), now_(std::move(now)), draw_(std::move(draw)) {
  if (!renderer.options().with_kept_picture)
    throw Error("no frame can be drawn within a time: the renderer was made to keep no picture");
}

TimedFrame TimedFrames::render(const FrameRequest &request, double budget_ms) {
  check_time_budget(budget_ms);
  const double begin = now_();
  check(request);
  TimedFrame frame;
  std::size_t step = kNumSteps - 1;
  double step_begin = begin;
  for (;;) {
    const FrameRequest of_step = request_of(request, step);
    double pass_begin = step_begin, first_pass_ms = 0;
    const bool may_be_cancelled = !frame.steps.empty();
    FrameRequest in_time = of_step;
    // Further passes have fewer rays, so the next one takes no longer than the last, mostly.
    in_time.on_pass = [&](const PassStats &pass) {
      const double now = now_(), pass_ms = now - pass_begin;
      if (first_pass_ms == 0) first_pass_ms = pass_ms;
      frame.stopped = request.on_pass && !request.on_pass(pass);
      pass_begin = now;
      return !frame.stopped && (!may_be_cancelled || now + pass_ms - begin <= budget_ms);
    };
    const FrameStats stats = draw_ ? draw_(in_time) : renderer_.render(in_time);
    const bool whole = !stats.cancelled,
               has_all_hits = stats.passes.back().counts.next_active_count == 0;
    const double now = now_(), step_ms = now - step_begin;
    frame.steps.push_back({*of_step.size, of_step.voxel_pixels, step_ms,
                           stats.passes.back().completed_percent, stats.cancelled});
    add(frame.stats, stats);
    frame.complete = whole && step == 0;
    if (!frame.stopped) last_ms_[step] = whole ? step_ms : 2 * step_ms;
    if (!has_all_hits && may_be_cancelled) renderer_.fill_from_kept();
    if (step == 0) break;
    renderer_.keep_picture();
    if (frame.stopped) break;
    const std::size_t next =
        whole ? next_step(step, step_ms, first_pass_ms, budget_ms - (now - begin)) : step;
    if (next == step) break;
    step = next;
    step_begin = now;
  }
  if (step != 0) renderer_.enlarge_kept(request);
  frame.stats.total_ms = now_() - begin;
  return frame;
}

/// Throws Error before anything is drawn.
void TimedFrames::check(const FrameRequest &request) const {
  renderer_.check(request);
  const ImageSize full = renderer_.size_of(request);
  const std::uint64_t most = halved(renderer_.options().size, 1).num_rays();
  if (halved(full, 1).num_rays() > most) {
    throw Error("half of {}x{} pixels cannot be kept: the renderer keeps a picture of {} rays",
                full.width, full.height, most);
  }
}

/// The frame with fewer rays, and levels of detail that suffice for them.
FrameRequest TimedFrames::request_of(const FrameRequest &request, std::size_t step) const {
  const ImageSize full = renderer_.size_of(request);
  const double scale = std::ldexp(1.0, static_cast<int>(step)) / full.samples;  // of its pixels
  FrameRequest smaller = request;
  smaller.size = halved(full, static_cast<unsigned>(step));
  if (step != 0 && renderer_.options().with_levels)
    smaller.voxel_pixels = std::max(1.0, request.voxel_pixels / scale);
  if (step != 0) smaller.ambient_rays = 0;
  return smaller;
}

/// After a step that took step_ms, and its first pass first_pass_ms: the step to draw in left_ms,
/// or `step` where there is no time.
std::size_t TimedFrames::next_step(std::size_t step, double step_ms, double first_pass_ms,
                                   double left_ms) const {
  std::size_t next = step;
  double expected = step_ms;
  for (std::size_t finer = step; finer-- > 0;) {
    expected = last_ms_[finer] > 0 ? last_ms_[finer] : kGrowth * expected;
    if (expected <= left_ms) next = finer;
  }
  // Part of a better picture is better than none.
  if (next == step && step > 0 && kGrowth * first_pass_ms <= left_ms) next = step - 1;
  return next;
}

}  // namespace isowave::core
