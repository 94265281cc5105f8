// Our sides of peer_bench.

#include <optional>
#include <utility>

#include "bench/frame_measure.hpp"
#include "bench/peer_sides.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/renderer.hpp"

namespace isowave::core::bench {

namespace {

class RendererSide : public PeerSide {
 public:
  RendererSide(const CompressedVolume &volume, const Camera &camera, ImageSize size,
               PipelineKind pipeline, const std::string &device)
      : camera_(camera),
        device_(ocl::choose_device(device)),
        renderer_(device_, volume, {.size = size, .pipeline = pipeline}) {}

  Measured draw(float isovalue) override {
    Measured measured;
    Stopwatch watch;
    draw(camera_, isovalue);
    watch.lap(measured, "new_kept");
    draw(camera_, previous_);
    renderer_.clear_cache();
    watch = {};
    measured["hit_count"] = static_cast<double>(draw(camera_, isovalue).rays_hit);
    watch.lap(measured, "new");
    draw(camera_, isovalue);
    watch.lap(measured, "warm");
    draw(turned(camera_), isovalue);
    watch.lap(measured, "next");
    measured["device_byte_count"] = static_cast<double>(device_.ledger().peak());
    previous_ = isovalue;
    return measured;
  }

 private:
  /// Like a mesh of triangles, with what a cell knows.
  FrameStats draw(const Camera &camera, float isovalue) {
    return renderer_.render({.camera = camera, .isovalue = isovalue, .normals = Normals::kCell});
  }

  Camera camera_;
  float previous_ = 0;
  ocl::Device device_;
  Renderer renderer_;
};

class HostSide : public PeerSide {
 public:
  HostSide(CompressedVolume volume, const Camera &camera, ImageSize size)
      : volume_(std::move(volume)), camera_(camera), size_(size), renderer_(volume_) {}

  Measured draw(float isovalue) override {
    Measured measured;
    Stopwatch watch;
    draw(camera_, isovalue);
    watch.lap(measured, "new_kept");
    renderer_.reset();  // its memory is free before that of the next is taken
    watch = {};
    renderer_.emplace(volume_);
    measured["hit_count"] = static_cast<double>(draw(camera_, isovalue).rays_hit);
    watch.lap(measured, "new");
    draw(camera_, isovalue);
    watch.lap(measured, "warm");
    draw(turned(camera_), isovalue);
    watch.lap(measured, "next");
    return measured;
  }

 private:
  FrameStats draw(const Camera &camera, float isovalue) {
    return renderer_->render(
        {.camera = camera, .isovalue = isovalue, .size = size_, .normals = Normals::kCell});
  }

  CompressedVolume volume_;
  Camera camera_;
  ImageSize size_;
  std::optional<HostRenderer> renderer_;
};

}  // namespace

std::unique_ptr<PeerSide> make_host_side(CompressedVolume volume, const Camera &camera,
                                         ImageSize size) {
  return std::make_unique<HostSide>(std::move(volume), camera, size);
}

std::unique_ptr<PeerSide> make_renderer_side(CompressedVolume volume, const Camera &camera,
                                             ImageSize size, PipelineKind pipeline,
                                             const std::string &device) {
  return std::make_unique<RendererSide>(volume, camera, size, pipeline, device);
}

}  // namespace isowave::core::bench
