#pragma once
// Draws at once by one renderer until another one is made, such as a device's renderer, which takes
// long because kernels are compiled.

#include <atomic>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>

#include "core/frame/renderer.hpp"
#include "core/frame/soon.hpp"

namespace isowave::core {

/// The two renderers of a SoonRenderer: how to make them, and their abilities before they are made.
/// Both draw the same volume, in this process alone.
struct SoonParts {
  Abilities abilities;  ///< abilities of the renderer that takes long
  /// Makes that renderer, in a thread of its own. Should throw soon if a stop is requested.
  std::function<std::shared_ptr<Renderer>(const std::stop_token &)> make;
  /// Called before the renderer that takes long works for a call, in the thread of that call.
  std::function<void()> before_use = [] {};
  Abilities meanwhile_abilities;  ///< abilities of the renderer that draws meanwhile
  /// Makes that renderer when a frame first needs it. If it throws, frames wait for the other
  /// renderer, and its error is not reported.
  std::function<std::unique_ptr<Renderer>()> make_meanwhile;
};

/// Draws by the renderer meanwhile until the other one is ready, and then by the other one. If the
/// other one becomes ready during a frame, it begins the frame anew (PassStats::begins_anew). A
/// request that the other one cannot draw is refused; one that the renderer meanwhile cannot draw
/// waits. If making the other renderer fails, each
/// call that needs it throws the error.
///
/// ready(), ready_for(), abilities(), memory_bytes(), wait() and give_up() may be called from any
/// thread.
class SoonRenderer : public RendererAround, public Soon {
 public:
  /// Returns at once.
  explicit SoonRenderer(SoonParts parts);
  /// Requests a stop, and waits for it.
  ~SoonRenderer() override = default;

  bool ready() const override { return is_ready_; }
  /// Whether render() does not wait until ready() for a request that needs such abilities.
  bool ready_for(const FrameRequest &request) const;
  void wait() const override;
  void give_up() override { maker_.request_stop(); }

  Abilities abilities() const override { return parts_.abilities; }
  const Abilities &meanwhile_abilities() const override { return parts_.meanwhile_abilities; }
  Team &team() override { return alone_; }
  /// Waits until ready() if no frame was drawn.
  std::vector<VolumeInfo> levels() const override;
  FrameStats render(const FrameRequest &request) override;
  std::vector<HitRecord> cast_rays(std::span<const WorldRay> rays, float isovalue,
                                   Normals normals) override;
  Camera camera(std::span<const float> isovalues, std::optional<ImageSize> size = {},
                const Viewpoint &from = {}) override;
  Camera label_camera(std::span<const std::uint16_t> labels, std::optional<ImageSize> size = {},
                      const Viewpoint &from = {}) override;
  void clear_cache() override;
  std::uint64_t memory_bytes() const override { return is_ready_ ? memory_bytes_.load() : 0; }
  double setup_ms() const override { return is_ready_ && made_ ? made_->setup_ms() : 0; }

 private:
  void make(const std::stop_token &stop);
  void note_memory();
  Renderer &wait_for_ready();
  Renderer *find_meanwhile();
  Renderer &find_any();
  Renderer &inner() const override;

  TeamOfOne alone_;  ///< also before there is a renderer
  SoonParts parts_;
  std::unique_ptr<Renderer> meanwhile_;
  bool has_meanwhile_ = true;     ///< false: it could not be made
  Renderer *drawn_by_ = nullptr;  ///< the last frame; null: none was drawn
  // The thread that makes the renderer writes both; others read them once is_ready_ is true.
  std::shared_ptr<Renderer> made_;
  std::exception_ptr failure_;
  std::atomic<std::uint64_t> memory_bytes_ = 0;
  std::atomic<bool> is_ready_ = false;
  std::jthread maker_;  ///< the last member: it ends before the others go
};

}  // namespace isowave::core
