#include "isowave/quick_renderer.hpp"

#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include "core/api/guarded.hpp"
#include "core/api/turns.hpp"
#include "core/base/error.hpp"

namespace isowave {

struct QuickRenderer::Implementation {
  Implementation(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume_drawn,
                 const RendererOptions &options, const HostRendererOptions &of_host)
      : volume(std::move(volume_drawn)), size(options.largest), host_options(of_host) {
    maker = std::jthread([this, device = std::move(device), options](const std::stop_token &stop) {
      make(device, options, stop);
    });
  }

  void make(const std::shared_ptr<Device> &device, const RendererOptions &options,
            const std::stop_token &stop);
  Renderer &device_renderer();
  HostRenderer *host_renderer();
  Frame draw(const FrameRequest &request);

  std::shared_ptr<const Volume> volume;
  ImageSize size;  ///< of the largest picture
  HostRendererOptions host_options;
  Turns mutex;                       ///< one frame at a time
  std::optional<HostRenderer> host;  ///< from the first frame on that the host draws
  bool has_host = true;              ///< false: the volume cannot be drawn there
  // Written by the thread that makes the renderer, and read by others once done is true.
  std::optional<Renderer> made;
  std::exception_ptr failure;
  std::atomic<bool> done = false;
  std::jthread maker;  ///< the last member: it ends before the others go
};

void QuickRenderer::Implementation::make(const std::shared_ptr<Device> &device,
                                         const RendererOptions &options,
                                         const std::stop_token &stop) {
  try {
    made.emplace(Renderer(device, volume, options, [&stop] {
      if (stop.stop_requested()) throw core::Error("the renderer is no longer wanted");
    }));
  } catch (...) {
    failure = std::current_exception();
  }
  done = true;
  done.notify_all();
}

/// Waits for it.
Renderer &QuickRenderer::Implementation::device_renderer() {
  core::check_not_forked();
  done.wait(false);
  if (failure) std::rethrow_exception(failure);
  return made.value();
}

/// Null where the device's renderer is ready, or the host cannot draw the volume.
HostRenderer *QuickRenderer::Implementation::host_renderer() {
  if (done) {
    host.reset();
    return nullptr;
  }
  if (!host && has_host) {
    try {
      host.emplace(volume, host_options);
    } catch (const Error &) {  // the limit; or a file, of which the device's renderer will tell
      has_host = false;
    }
  }
  return host ? &*host : nullptr;
}

Frame QuickRenderer::Implementation::draw(const FrameRequest &request) {
  if (done) {
    host.reset();
    return device_renderer().render(request);
  }
  HostRenderer *on_host = HostRenderer::can_draw(request) ? host_renderer() : nullptr;
  if (on_host == nullptr) return device_renderer().render(request);
  FrameRequest wanted = request;
  bool is_overtaken = false;
  wanted.on_pass = [&](const Progress &progress) {
    is_overtaken = done;
    return !is_overtaken && (!request.on_pass || request.on_pass(progress));
  };
  Frame frame = on_host->render(wanted);
  return is_overtaken ? draw(request) : frame;
}

QuickRenderer::QuickRenderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                             const RendererOptions &options,
                             const HostRendererOptions &host_options) {
  core::guarded("making a renderer", [&] {
    if (!device || !volume) throw core::Error("a renderer needs a device and a volume");
    Renderer::check_options(*device, *volume, options);
    implementation_ = std::make_unique<Implementation>(std::move(device), std::move(volume),
                                                       options, host_options);
  });
}

/// In a forked process, the thread that makes the renderer is not there.
QuickRenderer::~QuickRenderer() {
  if (core::is_forked()) static_cast<void>(implementation_.release());
}
QuickRenderer::QuickRenderer(QuickRenderer &&) noexcept = default;
QuickRenderer &QuickRenderer::operator=(QuickRenderer &&) noexcept = default;

Frame QuickRenderer::render(const FrameRequest &request) {
  const std::lock_guard lock(implementation_->mutex);
  return implementation_->draw(request);
}

Frame QuickRenderer::cast_rays(std::span<const Ray> rays, double isovalue, Normals normals) {
  const std::lock_guard lock(implementation_->mutex);
  if (HostRenderer *on_host = implementation_->host_renderer())
    return on_host->cast_rays(rays, isovalue, normals);
  return implementation_->device_renderer().cast_rays(rays, isovalue, normals);
}

Camera QuickRenderer::camera(double isovalue, std::optional<ImageSize> size) {
  const std::lock_guard lock(implementation_->mutex);
  if (const HostRenderer *on_host = implementation_->host_renderer())
    return on_host->camera(isovalue, size.value_or(implementation_->size));
  return implementation_->device_renderer().camera(isovalue, size);
}

bool QuickRenderer::ready() const {
  return implementation_->done;
}

void QuickRenderer::give_up() {
  implementation_->maker.request_stop();
}

void QuickRenderer::wait() const {
  implementation_->device_renderer();
}

std::uint64_t QuickRenderer::memory_bytes() const {
  return implementation_->done && implementation_->made ? implementation_->made->memory_bytes() : 0;
}

}  // namespace isowave
