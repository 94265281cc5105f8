// Our sides of peer_bench.

#include <optional>
#include <utility>

#include "bench/frame_measure.hpp"
#include "bench/peer_sides.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/renderer.hpp"

namespace isowave::core::bench {

namespace {

/// PeerSide::draw(). previous: the last isovalue, so that a new one's masks have to be made again.
template <class Side>
Measured measure(Side &side, const Camera &camera, float previous, float isovalue) {
  Measured measured;
  Stopwatch watch;
  side.draw(camera, isovalue);
  watch.lap(measured, "new_kept");
  side.draw(camera, previous);
  side.forget();
  watch = {};
  measured["hit_count"] = static_cast<double>(side.draw(camera, isovalue).rays_hit);
  watch.lap(measured, "new");
  side.draw(camera, isovalue);
  watch.lap(measured, "warm");
  side.draw(turned(camera), isovalue);
  watch.lap(measured, "next");
  return measured;
}

/// PeerSide::draw_views().
template <class Side>
std::vector<double> measure_views(Side &side, float previous, float isovalue,
                                  const std::vector<Camera> &cameras) {
  side.draw(cameras.at(0), previous);
  side.forget();
  std::vector<double> times;
  for (const Camera &camera : cameras) {
    Measured measured;
    Stopwatch watch;
    side.draw(camera, isovalue);
    watch.lap(measured, "view");
    times.push_back(measured.at("view_ms"));
  }
  return times;
}

class RendererSide : public PeerSide {
 public:
  RendererSide(const CompressedVolume &volume, const Camera &camera, ImageSize size,
               PipelinePtr pipeline, const std::string &device)
      : camera_(camera),
        device_(ocl::choose_device(device)),
        renderer_(device_, volume, {.size = size, .pipeline = std::move(pipeline)}) {}

  Measured draw(float isovalue) override {
    Measured measured = measure(*this, camera_, previous_, isovalue);
    measured["device_byte_count"] = static_cast<double>(device_.ledger().peak());
    previous_ = isovalue;
    return measured;
  }
  std::vector<double> draw_views(float isovalue, const std::vector<Camera> &cameras) override {
    return measure_views(*this, previous_, isovalue, cameras);
  }

  void forget() { renderer_.clear_cache(); }
  /// Like a mesh of triangles, with what a cell knows.
  FrameStats draw(const Camera &camera, float isovalue) {
    return renderer_.render({.camera = camera, .isovalue = isovalue, .normals = Normals::kCell});
  }

 private:
  Camera camera_;
  float previous_ = 0;
  ocl::Device device_;
  Renderer renderer_;
};

class HostSide : public PeerSide {
 public:
  HostSide(CompressedVolume volume, const Camera &camera, ImageSize size)
      : volume_(std::move(volume)), camera_(camera), size_(size) {
    Stopwatch watch;
    renderer_.emplace(volume_);
    watch.lap(opened_, "open");
  }

  Measured draw(float isovalue) override {
    Measured measured = measure(*this, camera_, previous_, isovalue);
    measured.insert(opened_.begin(), opened_.end());
    measured["renderer_byte_count"] = static_cast<double>(renderer_->memory_bytes());
    previous_ = isovalue;
    return measured;
  }
  std::vector<double> draw_views(float isovalue, const std::vector<Camera> &cameras) override {
    return measure_views(*this, previous_, isovalue, cameras);
  }

  void forget() { renderer_->clear_cache(); }
  FrameStats draw(const Camera &camera, float isovalue) {
    return renderer_->render(
        {.camera = camera, .isovalue = isovalue, .size = size_, .normals = Normals::kCell});
  }

 private:
  CompressedVolume volume_;
  Camera camera_;
  float previous_ = 0;
  ImageSize size_;
  Measured opened_;
  std::optional<HostRenderer> renderer_;
};

}  // namespace

std::unique_ptr<PeerSide> make_host_side(CompressedVolume volume, const Camera &camera,
                                         ImageSize size) {
  return std::make_unique<HostSide>(std::move(volume), camera, size);
}

std::unique_ptr<PeerSide> make_renderer_side(CompressedVolume volume, const Camera &camera,
                                             ImageSize size, PipelinePtr pipeline,
                                             const std::string &device) {
  return std::make_unique<RendererSide>(volume, camera, size, std::move(pipeline), device);
}

}  // namespace isowave::core::bench
