#include "isowave/host_renderer.hpp"

#include <algorithm>
#include <mutex>
#include <utility>

#include "core/api/convert.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/turns.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/host/host_renderer.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

using core::guarded;

void check(const FrameRequest &request) {
  if (request.max_surface_error)
    throw core::Error("bounds of the error are for devices alone: leave out max_surface_error");
  if (request.want_bounds)
    throw core::Error("bounds of the error are for devices alone: leave out want_bounds");
  if (request.time_budget_ms)
    throw core::Error("a time budget is for devices alone: leave out time_budget_ms");
  core::HostRenderer::check(core_request(request, {}));
}

/// The frame at work, for on_pass.
class HostProgress : public ProgressInTurns {
 public:
  HostProgress(const core::HostRenderer &renderer, const FrameRequest &request)
      : renderer_(renderer),
        size_(request.size),
        appearance_(core_appearance(request.appearance)) {}

 private:
  ImageSize current_size() const override { return size_; }
  std::vector<std::uint8_t> draw_picture() const override {
    return renderer_.shade(appearance_).pixels;
  }

  const core::HostRenderer &renderer_;
  ImageSize size_;
  core::Appearance appearance_;
};

}  // namespace

struct HostRenderer::Implementation {
  Implementation(std::shared_ptr<const Volume> volume_drawn, const HostRendererOptions &options)
      : volume(std::move(volume_drawn)),
        renderer(volume->implementation().volume, {options.memory_limit, options.num_threads}) {}

  Frame draw(const FrameRequest &request);

  std::shared_ptr<const Volume> volume;
  mutable Turns mutex;  ///< one frame at a time
  core::HostRenderer renderer;
};

Frame HostRenderer::Implementation::draw(const FrameRequest &request) {
  check(request);
  core::FrameRequest wanted = core_request(request, volume->implementation().volume);
  HostProgress progress(renderer, request);
  if (request.on_pass) {
    wanted.on_pass = [&](const core::PassStats &pass) {
      return progress.show(pass, request.on_pass);
    };
  }
  Frame frame;
  describe_frame(request, renderer.render(wanted), frame);
  frame.statistics.errors_are_stated = volume->errors_are_stated();
  if (request.want_picture)
    frame.picture = renderer.shade(core_appearance(request.appearance)).pixels;
  fill_frame(request, renderer.hits(), volume->implementation().volume, false, frame);
  return frame;
}

HostRenderer::HostRenderer(std::shared_ptr<const Volume> volume,
                           const HostRendererOptions &options) {
  guarded("making a renderer", [&] {
    if (!volume) throw core::Error("a renderer needs a volume");
    implementation_ = std::make_unique<Implementation>(std::move(volume), options);
  });
}

HostRenderer::~HostRenderer() = default;
HostRenderer::HostRenderer(HostRenderer &&) noexcept = default;
HostRenderer &HostRenderer::operator=(HostRenderer &&) noexcept = default;

Frame HostRenderer::render(const FrameRequest &request) {
  return guarded("rendering", [&] {
    const std::lock_guard lock(implementation_->mutex);
    return implementation_->draw(request);
  });
}

Frame HostRenderer::cast_rays(std::span<const Ray> rays, double isovalue, Normals normals) {
  return guarded("casting rays", [&] {
    const std::lock_guard lock(implementation_->mutex);
    const core::CompressedVolume &compressed = volume()->implementation().volume;
    return frame_of_rays(implementation_->renderer.cast_rays(
                             world_rays(rays), core::drawn_isovalue(compressed, isovalue),
                             static_cast<core::Normals>(normals)),
                         compressed, false);
  });
}

bool HostRenderer::can_draw(const FrameRequest &request) {
  try {
    check(request);
    return true;
  } catch (const Error &) {
    return false;
  }
}

Camera HostRenderer::camera(double isovalue, const ImageSize &size) const {
  return guarded("looking for the surface", [&] {
    const std::lock_guard lock(implementation_->mutex);
    const float drawn = core::drawn_isovalue(volume()->implementation().volume, isovalue);
    return public_camera(implementation_->renderer.camera(drawn, core_size(size)));
  });
}

const std::shared_ptr<const Volume> &HostRenderer::volume() const {
  return implementation_->volume;
}

std::uint64_t HostRenderer::memory_bytes() const {
  return implementation_->renderer.memory_bytes();
}

}  // namespace isowave
