// Our sides of peer_bench.

#include <optional>
#include <utility>

#include "bench/frame_measure.hpp"
#include "bench/peer_sides.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave::core::bench {

namespace {

/// A renderer of a device, or of the host.
class RendererSide : public PeerSide {
 public:
  /// On a device.
  RendererSide(CompressedVolume volume, const PeerFrames &frames, PipelinePtr pipeline,
               const std::string &device)
      : volume_(std::move(volume)), frames_(frames) {
    device_.emplace(ocl::choose_device(device));
    renderer_ = std::make_unique<DeviceRenderer>(
        *device_, volume_, RendererOptions{.size = frames.size, .pipeline = std::move(pipeline)});
  }
  /// On the host.
  RendererSide(CompressedVolume volume, const PeerFrames &frames)
      : volume_(std::move(volume)), frames_(frames) {
    Stopwatch watch;
    renderer_ = std::make_unique<HostRenderer>(volume_);
    watch.lap(opened_, "open");
  }

  Measured draw(float isovalue, const Camera &camera, Image8 *picture) override {
    Measured measured = opened_;
    if (previous_ == isovalue) {
      previous_ = isovalue == 0 ? 1.0f : 0.0f;
      draw_frame(camera, previous_);
    }
    Stopwatch watch;
    draw_frame(camera, isovalue);
    watch.lap(measured, "new_kept");
    draw_frame(camera, previous_);
    renderer_->clear_cache();
    watch = {};
    measured["hit_count"] = static_cast<double>(draw_frame(camera, isovalue).rays_hit);
    watch.lap(measured, "new");
    draw_frame(camera, isovalue);
    watch.lap(measured, "warm");
    if (picture != nullptr) *picture = image_of(frames_.size, arrays_.picture);
    watch = {};
    draw_frame(turned(camera), isovalue);
    watch.lap(measured, "next");
    if (device_) {
      measured["device_byte_count"] = static_cast<double>(device_->ledger().peak());
    } else {
      measured["renderer_byte_count"] = static_cast<double>(renderer_->memory_bytes());
    }
    previous_ = isovalue;
    return measured;
  }
  std::vector<double> draw_views(float isovalue, const std::vector<Camera> &cameras) override {
    draw_frame(cameras.at(0), previous_);
    renderer_->clear_cache();
    std::vector<double> times;
    for (const Camera &camera : cameras) {
      Measured measured;
      Stopwatch watch;
      draw_frame(camera, isovalue);
      watch.lap(measured, "view");
      times.push_back(measured.at("view_ms"));
    }
    return times;
  }

 private:
  FrameStats draw_frame(const Camera &camera, float isovalue) {
    arrays_ = {};  // its memory serves the next ones
    FrameStats stats = renderer_->render(
        {.camera = camera, .isovalue = isovalue, .size = frames_.size, .normals = frames_.normals});
    arrays_ = renderer_->fetch({.picture = true}, {});
    return stats;
  }

  CompressedVolume volume_;
  PeerFrames frames_;
  /// The last frame's isovalue. A new isovalue's masks have to be made again.
  float previous_ = 0;
  Measured opened_;
  std::optional<ocl::Device> device_;  ///< before the renderer, which it must outlive
  std::unique_ptr<Renderer> renderer_;
  FrameArrays arrays_;  ///< of the last frame
};

}  // namespace

std::unique_ptr<PeerSide> make_host_side(CompressedVolume volume, const PeerFrames &frames) {
  return std::make_unique<RendererSide>(std::move(volume), frames);
}

std::unique_ptr<PeerSide> make_renderer_side(CompressedVolume volume, const PeerFrames &frames,
                                             PipelinePtr pipeline, const std::string &device) {
  return std::make_unique<RendererSide>(std::move(volume), frames, std::move(pipeline), device);
}

}  // namespace isowave::core::bench
