#pragma once
// Frames within a time: first a small picture with coarse levels of detail, then larger and finer
// ones, as long as there is time. What is drawn depends on timings, unlike everything else in
// isowave; a whole picture is there however short the time.

#include <array>
#include <functional>
#include <vector>

#include "core/render/renderer.hpp"

namespace isowave::core {

/// A picture that was drawn on the way. Where it was cancelled, since time was over, and has no hit
/// yet, the one before shows through.
struct TimedStep {
  ImageSize size;
  double voxel_pixels = 0;       ///< of its own pixels
  double ms = 0;                 ///< wall clock
  double completed_percent = 0;  ///< of its pixels
  bool cancelled = false;
};

struct TimedFrame {
  std::vector<TimedStep> steps;  ///< as they were drawn, each with more pixels
  FrameStats stats;              ///< of all steps; rays_hit and cancelled of the last
  bool stopped = false;          ///< by on_pass, not by the time
  bool complete = false;         ///< the hit buffer holds what Renderer::render() draws
};

/// Draws frames of a renderer made with_kept_picture, in steps: 1/8, 1/4, 1/2 of the rays along
/// each axis, then all of them as the request says. Pictures of fewer rays have one for each
/// pixel. Where the renderer has levels of detail, smaller pictures use those whose voxels are at
/// most one of their pixels apart.
class TimedFrames {
 public:
  using Clock = std::function<double()>;  ///< [ms]
  using Draw = std::function<FrameStats(const FrameRequest &)>;

  /// now: for tests, and for bricks, which decide alike; draw: instead of Renderer::render(), with
  /// that renderer. `renderer` must outlive this.
  ///
  /// Throws  Error: it was made to keep no picture
  explicit TimedFrames(Renderer &renderer, Clock now = steady_clock_ms, Draw draw = {});

  /// Draws the smallest picture, however long it takes, then the largest that is expected to be
  /// whole in time, by what steps took in the frame before, and so on. A picture that is not whole
  /// in time is filled from the one before. The hit buffer holds a picture of the full size. The
  /// request's on_pass is called after each pass, while the renderer has a picture of the step's
  /// size; where it returns false, the frame ends there, be it in the smallest picture.
  ///
  /// Throws  Error unless budget_ms is finite and above 0, where half of the picture is larger than
  ///         what the renderer keeps, and as Renderer::render() does
  TimedFrame render(const FrameRequest &request, double budget_ms);

  static double steady_clock_ms();

 private:
  static constexpr std::size_t kNumSteps = 4;  ///< 1/8 to 1/1; steps count down to 0, all rays

  void check(const FrameRequest &request) const;
  FrameRequest request_of(const FrameRequest &request, std::size_t step) const;
  std::size_t next_step(std::size_t step, double step_ms, double first_pass_ms,
                        double left_ms) const;

  Renderer &renderer_;
  Clock now_;
  Draw draw_;
  std::array<double, kNumSteps>
      last_ms_{};  ///< what each step took when it was drawn last; 0: unknown
};

/// Throws  Error unless it is finite and above 0
void check_time_budget(double budget_ms);

}  // namespace isowave::core
