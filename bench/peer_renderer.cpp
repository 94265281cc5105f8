// Our sides of peer_bench.

#include <optional>
#include <utility>

#include "bench/frame_measure.hpp"
#include "bench/peer_sides.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave::core::bench {

namespace {

/// A renderer of a device, or of the host. Like a mesh of triangles, frames have the normals that
/// cells know.
class RendererSide : public PeerSide {
 public:
  /// On a device.
  RendererSide(CompressedVolume volume, const Camera &camera, ImageSize size, PipelinePtr pipeline,
               const std::string &device)
      : volume_(std::move(volume)), camera_(camera), size_(size) {
    device_.emplace(ocl::choose_device(device));
    renderer_ = std::make_unique<DeviceRenderer>(
        *device_, volume_, RendererOptions{.size = size, .pipeline = std::move(pipeline)});
  }
  /// On the host.
  RendererSide(CompressedVolume volume, const Camera &camera, ImageSize size)
      : volume_(std::move(volume)), camera_(camera), size_(size) {
    Stopwatch watch;
    renderer_ = std::make_unique<HostRenderer>(volume_);
    watch.lap(opened_, "open");
  }

  Measured draw(float isovalue) override {
    Measured measured = opened_;
    Stopwatch watch;
    draw(camera_, isovalue);
    watch.lap(measured, "new_kept");
    draw(camera_, previous_);
    renderer_->clear_cache();
    watch = {};
    measured["hit_count"] = static_cast<double>(draw(camera_, isovalue).rays_hit);
    watch.lap(measured, "new");
    draw(camera_, isovalue);
    watch.lap(measured, "warm");
    draw(turned(camera_), isovalue);
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
    draw(cameras.at(0), previous_);
    renderer_->clear_cache();
    std::vector<double> times;
    for (const Camera &camera : cameras) {
      Measured measured;
      Stopwatch watch;
      draw(camera, isovalue);
      watch.lap(measured, "view");
      times.push_back(measured.at("view_ms"));
    }
    return times;
  }

 private:
  FrameStats draw(const Camera &camera, float isovalue) {
    FrameStats stats = renderer_->render(
        {.camera = camera, .isovalue = isovalue, .size = size_, .normals = Normals::kCell});
    renderer_->fetch({.picture = true}, {});
    return stats;
  }

  CompressedVolume volume_;
  Camera camera_;
  ImageSize size_;
  /// The last frame's isovalue. A new isovalue's masks have to be made again.
  float previous_ = 0;
  Measured opened_;
  std::optional<ocl::Device> device_;  ///< before the renderer, which it must outlive
  std::unique_ptr<Renderer> renderer_;
};

}  // namespace

std::unique_ptr<PeerSide> make_host_side(CompressedVolume volume, const Camera &camera,
                                         ImageSize size) {
  return std::make_unique<RendererSide>(std::move(volume), camera, size);
}

std::unique_ptr<PeerSide> make_renderer_side(CompressedVolume volume, const Camera &camera,
                                             ImageSize size, PipelinePtr pipeline,
                                             const std::string &device) {
  return std::make_unique<RendererSide>(std::move(volume), camera, size, std::move(pipeline),
                                        device);
}

}  // namespace isowave::core::bench
