#pragma once
// Frames within a time: first a small picture with coarse levels of detail, then larger and finer
// ones, as long as there is time. Unlike everything else in isowave, these pictures depend on
// timings. There is a whole picture for any time, however short.

#include <array>
#include <functional>

#include "core/frame/renderer.hpp"

namespace isowave::core {

/// Draws frames with a time budget by a renderer that can keep a picture, in steps: with 1/8, 1/4
/// and 1/2 of the rays along each axis, then with all rays. Smaller pictures have one ray per
/// pixel. If that makes them faster (Abilities::levels_pay), they use levels of detail whose voxels
/// are at most one of their pixels apart; else those of the whole picture, so that a step finds the
/// blocks of the step before decoded. A budget ends when the arrays that are fetched are in the
/// host's memory, if those of the frame before were the same. Requests without a budget are handed
/// on.
class TimedRenderer : public RendererAround {
 public:
  using Clock = std::function<double()>;  ///< [ms]

  /// now: for tests. A team takes rank 0's time. A rank may make its renderer while others do not.
  ///
  /// Throws  Error: the renderer was made to keep no picture
  explicit TimedRenderer(Renderer &inner, Clock now = steady_clock_ms)
      : RendererAround(inner), now_(std::move(now)) {
    check_keeps_picture();
  }
  explicit TimedRenderer(std::unique_ptr<Renderer> inner, Clock now = steady_clock_ms)
      : RendererAround(std::move(inner)), now_(std::move(now)) {
    check_keeps_picture();
  }

  Abilities abilities() const override;

  /// Draws a first picture, however long that takes: the smallest one, or for further frames of an
  /// isovalue the largest one that last took at most half of the time, unless a larger one than
  /// that is expected to be whole in time behind the smallest. Each further step draws the largest
  /// picture that is expected to be whole in time, by the times of earlier frames. If a picture is
  /// not whole in time, the picture before fills it. The hit buffer then holds a picture
  /// of the full size. The request's on_pass is called after each pass, while the renderer has a
  /// picture of the step's size. If it returns false, the frame ends, even in the smallest picture.
  ///
  /// Returns  the statistics of all steps; rays_hit is the last step's, cancelled says whether
  ///          on_pass stopped the frame
  /// Throws   Error: half of the picture is larger than the renderer can keep
  FrameStats render(const FrameRequest &request) override;

  /// Takes its time, which the next frames leave for it.
  FrameArrays fetch(const WantedArrays &wanted, const Appearance &appearance) override;

  static double steady_clock_ms();

 private:
  static constexpr std::size_t kNumSteps = 4;  ///< 1/8 to 1/1; steps count down to 0, all rays

  /// One step's frame, and what decides about the next step.
  struct Drawn {
    FrameStats stats;
    double first_pass_ms = 0;
    double expected_ms = 0;  ///< of the whole picture, as it seemed after the last pass
    bool is_stopped = false;
  };

  void check_keeps_picture();
  void check_can_keep(const FrameRequest &request) const;
  double now_ms();
  FrameRequest request_of(const FrameRequest &request, std::size_t step) const;
  Drawn draw_step(const FrameRequest &request, std::size_t step, bool is_first, double begin_ms,
                  double end_ms);
  void remember(std::size_t step, const TimedStep &timed, const Drawn &drawn);
  double expected_ms(std::size_t step) const;
  std::size_t first_step(float isovalue, double left_ms) const;
  std::size_t next_step(std::size_t step, double first_pass_ms, double left_ms) const;

  Clock now_;
  bool levels_pay_ = false;  ///< at rank 0, for this frame: all ranks must decide alike
  /// Time of each step when it was drawn last [ms]; 0: unknown. If it was not whole, a guess.
  std::array<double, kNumSteps> last_ms_{};
  std::array<bool, kNumSteps> is_guess_{};
  /// Time of a whole picture for each millisecond of its first pass, in the last step that was
  /// whole.
  double whole_per_first_pass_ = 1;
  std::optional<float> isovalue_{};  ///< of the last frame
  double fetch_ms_ = 0;              ///< time of the last fetch() after a frame
};

}  // namespace isowave::core
