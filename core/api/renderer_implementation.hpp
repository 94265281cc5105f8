#pragma once
// Private to core/api: what is behind isowave::Renderer.

#include <atomic>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/accuracy/certify.hpp"
#include "core/api/turns.hpp"
#include "core/frame/renderer.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "isowave/device.hpp"
#include "isowave/renderer.hpp"

namespace isowave {

struct Renderer::Implementation {
  virtual ~Implementation() = default;
  virtual Frame render(const FrameRequest &request) = 0;
  virtual Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals) = 0;
  virtual Camera camera(double isovalue, std::optional<ImageSize> size) = 0;
  virtual bool can_draw(const FrameRequest &request) const = 0;
  virtual bool ready() const { return true; }
  virtual bool ready_for(const FrameRequest &) const { return true; }
  virtual void wait() const {}
  virtual void give_up() {}
  virtual std::string isovalue_notice(double isovalue) const = 0;
  virtual std::uint64_t memory_bytes() const = 0;
  virtual double setup_ms() const = 0;

  std::shared_ptr<Device> device{};
  std::shared_ptr<const Volume> volume{};
  DeviceInfo device_info{};
  Grid grid{};
  std::vector<std::string> notices{};
};

/// What the program reports of a frame, beside what Frame says.
struct LastFrame {
  core::FrameStats stats{};
  core::Certificate certificate{};  ///< with FrameRequest::want_bounds; its bounds are Frame's
};

/// Draws by a renderer of core.
class CoreImplementation : public Renderer::Implementation {
 public:
  /// keep    what renderer, volume and turns need, which goes after them
  /// of      the volume that this process draws
  /// turns   of calls: those of the device, if other renderers use it
  CoreImplementation(std::shared_ptr<const void> keep, const core::CompressedVolume &of,
                     Turns &turns, std::unique_ptr<core::Renderer> renderer);
  /// Buffers go while no other thread drives the device.
  ~CoreImplementation() override;

  Frame render(const FrameRequest &request) override;
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals) override;
  Camera camera(double isovalue, std::optional<ImageSize> size) override;
  bool can_draw(const FrameRequest &request) const override;
  std::string isovalue_notice(double isovalue) const override;
  std::uint64_t memory_bytes() const override { return memory_bytes_; }
  double setup_ms() const override { return renderer_->setup_ms(); }
  core::Renderer &core() { return *renderer_; }
  const LastFrame &last() const { return last_; }

 private:
  Frame draw(const FrameRequest &request);
  void fetch(const FrameRequest &request, Frame &frame);
  /// For other threads, that may ask while a frame is drawn.
  void note_memory() { memory_bytes_ = renderer_->memory_bytes(); }

  std::shared_ptr<const void> keep_;
  const core::CompressedVolume &volume_;
  Turns &turns_;
  std::unique_ptr<core::Renderer> renderer_;
  LastFrame last_;
  std::atomic<std::uint64_t> memory_bytes_ = 0;
};

}  // namespace isowave
