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
#include "core/frame/soon.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "isowave/device.hpp"
#include "isowave/renderer.hpp"

namespace isowave {

/// Facts of a frame that the program reports, beside those of Frame.
struct LastFrame {
  core::FrameStats stats{};
  core::Certificate certificate{};  ///< with FrameRequest::want_bounds; its bounds are Frame's
};

struct Renderer::Implementation {
  /// turns   of calls: those of the device, if other renderers use it
  /// of      the volume that this process draws, which must outlive this
  Implementation(std::shared_ptr<Turns> turns, const core::CompressedVolume &of,
                 std::unique_ptr<core::Renderer> renderer);
  /// The same for a volume that the user has opened.
  Implementation(std::shared_ptr<Turns> turns, std::shared_ptr<const Volume> of,
                 std::unique_ptr<core::Renderer> renderer);
  /// Buffers go while no other thread drives the device.
  ~Implementation();
  Implementation(const Implementation &) = delete;
  Implementation &operator=(const Implementation &) = delete;

  Frame render(const FrameRequest &request);
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals);
  std::vector<Camera> turntable(const std::vector<Surface> &surfaces, std::uint32_t num_views,
                                std::optional<ImageSize> size, const Viewpoint &from);
  bool can_draw(const FrameRequest &request) const;
  bool ready() const { return soon == nullptr || soon->ready(); }
  bool ready_for(const FrameRequest &request) const;
  void wait() const {
    if (soon != nullptr) soon->wait();
  }
  std::string isovalue_notice(double isovalue) const;
  std::uint64_t memory_bytes() const { return soon ? soon->memory_bytes() : memory_bytes_.load(); }
  double setup_ms() const { return renderer_->setup_ms(); }
  core::Renderer &core() { return *renderer_; }
  const LastFrame &last() const { return last_; }

  std::shared_ptr<Device> device{};
  std::shared_ptr<const Volume> volume{}, field{};
  DeviceInfo device_info{};
  Grid grid{};
  std::vector<std::string> notices{};
  core::Soon *soon = nullptr;  ///< the renderer, if it is one

 private:
  /// The whole volume's finest level, without waiting until a device is ready.
  core::VolumeInfo whole() {
    return renderer_->team().size() > 1 ? renderer_->levels().front() : volume_.info;
  }
  core::Camera box_camera(core::ImageSize size, const core::Viewpoint &from);
  Frame draw(const FrameRequest &request);
  void fetch(const FrameRequest &request, Frame &frame);
  /// For other threads, that may ask while a frame is drawn.
  void note_memory() { memory_bytes_ = renderer_->memory_bytes(); }

  std::shared_ptr<Turns> turns_;
  const core::CompressedVolume &volume_;
  std::unique_ptr<core::Renderer> renderer_;
  LastFrame last_;
  core::HostMemory memory_;  ///< of Frame::hits
  std::atomic<std::uint64_t> memory_bytes_ = 0;
};

}  // namespace isowave
