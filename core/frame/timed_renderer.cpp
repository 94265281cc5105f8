#include "core/frame/timed_renderer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

/// Number of pixels of a step for each pixel of the step before.
constexpr double kGrowth = 4;
/// A step takes this many times as long as the step before, at least. Fewer would be noise.
constexpr double kLeastGrowth = 1.25;
/// What a guess is multiplied by from frame to frame, so that it is tried again some time.
constexpr double kGuessDecay = 0.9;

/// Adds a step's statistics to those of the steps before.
void add(FrameStats &sum, FrameStats step) {
  step.passes.insert(step.passes.begin(), sum.passes.begin(), sum.passes.end());
  step.normals += sum.normals;
  step.ambient += sum.ambient;
  step.uploaded_blocks += sum.uploaded_blocks;
  step.uploaded_bytes += sum.uploaded_bytes;
  step.steps = std::move(sum.steps);
  sum = std::move(step);
}

/// A step is as complete as its least advanced rank.
double least_percent(Team &team, double percent) {
  return std::ranges::min(gather(team, std::vector{percent}));
}

}  // namespace

double TimedRenderer::steady_clock_ms() {
  return std::chrono::duration<double, std::milli>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void TimedRenderer::check_keeps_picture() {
  if (!inner().abilities().kept_picture)
    throw Error("no frame can be drawn within a time: the renderer was made to keep no picture");
}

Abilities TimedRenderer::abilities() const {
  Abilities abilities = inner().abilities();
  abilities.time_budget = true;
  return abilities;
}

/// The time, of rank 0 at all ranks: all ranks must decide alike.
double TimedRenderer::now_ms() {
  return of_first(team(), std::vector{now_()}).front();
}

FrameStats TimedRenderer::render(const FrameRequest &request) {
  if (!request.time_budget_ms) return inner().render(request);
  core::check(request, abilities());
  check_can_keep(request);
  levels_pay_ = of_first(team(), std::vector{abilities().levels_pay ? 1.0 : 0.0}).front() != 0;
  const double fetch_ms = fetch_ms_;
  const double begin = now_ms(), end = begin + *request.time_budget_ms - fetch_ms;
  FrameStats sum;
  for (std::size_t i = 0; i < kNumSteps; ++i) last_ms_[i] *= is_guess_[i] ? kGuessDecay : 1;
  std::size_t step = first_step(request.isovalue, end - begin);
  isovalue_ = request.isovalue;
  for (double step_begin = begin;;) {
    const bool is_first = sum.steps.empty();
    Drawn drawn = draw_step(request, step, is_first, step_begin, end);
    const FrameStats &stats = drawn.stats;
    const bool is_whole = !stats.cancelled,
               has_all_hits = stats.passes.back().counts.next_active_count == 0;
    const double now = now_ms(), step_ms = now - step_begin;
    const FrameRequest of_step = request_of(request, step);
    sum.steps.push_back({*of_step.size, of_step.voxel_pixels, step_ms,
                         least_percent(team(), stats.passes.back().completed_percent),
                         stats.cancelled});
    if (!drawn.is_stopped) remember(step, sum.steps.back(), drawn);
    if (!has_all_hits && !is_first) fill_from_kept();
    add(sum, std::move(drawn.stats));
    sum.cancelled = drawn.is_stopped;
    sum.complete = is_whole && step == 0;
    if (step == 0) break;
    keep_picture();
    if (drawn.is_stopped) break;
    const std::size_t next = is_whole ? next_step(step, drawn.first_pass_ms, end - now) : step;
    if (next == step) break;
    step = next;
    step_begin = now;
  }
  if (step != 0) enlarge_kept(request_of(request, 0));
  fetch_ms_ = fetch_ms;  // on_pass may have fetched small pictures
  sum.total_ms = now_ms() - begin;
  return sum;
}

FrameArrays TimedRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  const double begin = now_ms();
  FrameArrays arrays = inner().fetch(wanted, appearance);
  fetch_ms_ = now_ms() - begin;
  return arrays;
}

/// Draws a step; the first one to its end, the others until the time is over.
TimedRenderer::Drawn TimedRenderer::draw_step(const FrameRequest &request, std::size_t step,
                                              bool is_first, double begin_ms, double end_ms) {
  Drawn drawn;
  FrameRequest in_time = request_of(request, step);
  in_time.on_progress = {};
  double pass_begin = begin_ms;
  // Further passes have fewer rays, so the next one mostly takes no longer than the last, or than
  // what the whole picture is expected to take from now on.
  in_time.on_pass = [&](const PassStats &pass) {
    const double now = now_ms(), pass_ms = now - pass_begin, drawn_ms = now - begin_ms;
    if (drawn.first_pass_ms == 0) {
      drawn.first_pass_ms = pass_ms;
      const bool is_known = last_ms_[step] > 0 && !is_guess_[step];
      drawn.expected_ms = is_known ? last_ms_[step] : whole_per_first_pass_ * pass_ms;
    }
    if (drawn_ms >= drawn.expected_ms) drawn.expected_ms = drawn_ms + pass_ms;
    const double left_ms = std::min(pass_ms, drawn.expected_ms - drawn_ms);
    drawn.is_stopped = request.on_pass && !request.on_pass(pass);
    pass_begin = now;
    return !drawn.is_stopped && (is_first || now + left_ms <= end_ms);
  };
  drawn.stats = inner().render(in_time);
  drawn.is_stopped = any_of(team(), drawn.is_stopped);
  return drawn;
}

/// Learns from a step, from what all ranks know alike. If rays were left when its time was over,
/// how many passes they take is unknown.
void TimedRenderer::remember(std::size_t step, const TimedStep &timed, const Drawn &drawn) {
  is_guess_[step] = timed.cancelled && timed.completed_percent < 100;
  last_ms_[step] = !timed.cancelled ? timed.ms : is_guess_[step] ? 2 * timed.ms : drawn.expected_ms;
  if (!timed.cancelled && drawn.first_pass_ms > 0)
    whole_per_first_pass_ = timed.ms / drawn.first_pass_ms;
}

/// Throws Error before anything is drawn.
void TimedRenderer::check_can_keep(const FrameRequest &request) const {
  const Abilities can = abilities();
  const ImageSize full = size_of(request, can);
  // A renderer of pictures of any size keeps pictures of any size.
  const std::uint64_t most =
      can.most_rays == Abilities{}.most_rays ? can.most_rays : halved(can.largest, 1).num_rays();
  if (halved(full, 1).num_rays() > most) {
    throw Error("half of {}x{} pixels cannot be kept: the renderer keeps a picture of {} rays",
                full.width, full.height, most);
  }
}

/// The frame with fewer rays, and levels of detail that suffice for them.
FrameRequest TimedRenderer::request_of(const FrameRequest &request, std::size_t step) const {
  const Abilities can = abilities();
  const ImageSize full = size_of(request, can);
  const double scale = std::ldexp(1.0, static_cast<int>(step)) / full.samples;  // of its pixels
  FrameRequest smaller = step == 0 ? request : without_light_rays(request);
  smaller.time_budget_ms.reset();
  smaller.size = halved(full, static_cast<unsigned>(step));
  if (step != 0)
    smaller.voxel_pixels = std::max(levels_pay_ ? 1.0 : 0.0, request.voxel_pixels / scale);
  return smaller;
}

/// Time of a step by earlier frames [ms]; 0: unknown. A step that was never drawn takes as much
/// more than the step before as it has more pixels, beside what any picture takes: the steps before
/// tell how much that is.
double TimedRenderer::expected_ms(std::size_t step) const {
  if (last_ms_[step] > 0 || step + 1 == kNumSteps) return last_ms_[step];
  const double before = expected_ms(step + 1);
  const bool knows_two = step + 2 < kNumSteps && last_ms_[step + 1] > 0 && last_ms_[step + 2] > 0;
  if (!knows_two) return kGrowth * before;
  return std::clamp(before + kGrowth * (before - last_ms_[step + 2]), kLeastGrowth * before,
                    kGrowth * before);
}

/// The step to begin with: a picture of another isovalue takes longer than the last, so the
/// smallest. The first picture cannot be cancelled, so there must be time for it twice.
std::size_t TimedRenderer::first_step(float isovalue, double left_ms) const {
  constexpr std::size_t kSmallest = kNumSteps - 1;
  if (isovalue_ != isovalue) return kSmallest;
  for (std::size_t step = 0; step < kSmallest; ++step) {
    if (is_guess_[step]) continue;
    if (last_ms_[step] > 0 && last_ms_[step] <= left_ms / 2) return step;
    if (last_ms_[kSmallest] + expected_ms(step) <= left_ms) return kSmallest;
  }
  return kSmallest;
}

/// After a step, whose first pass took first_pass_ms: the step to draw in left_ms, or `step` if
/// there is no time.
std::size_t TimedRenderer::next_step(std::size_t step, double first_pass_ms, double left_ms) const {
  std::size_t next = step;
  for (std::size_t finer = step; finer-- > 0;) {
    if (expected_ms(finer) <= left_ms) next = finer;
  }
  // A part of a better picture is better than none.
  if (next == step && step > 0 && kGrowth * first_pass_ms <= left_ms) next = step - 1;
  return next;
}

}  // namespace isowave::core
