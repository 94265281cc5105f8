#include "isowave/quick_renderer.hpp"

#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include "core/api/device_implementation.hpp"
#include "core/api/device_renderer.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/render/renderer_options.hpp"

namespace isowave {

namespace {

/// A renderer of the host until one of the device is made.
class QuickImplementation : public Renderer::Implementation {
 public:
  QuickImplementation(const std::shared_ptr<Device> &on, std::shared_ptr<const Volume> of,
                      const RendererOptions &options, const HostRendererOptions &of_host)
      : size_(options.largest), host_options_(of_host) {
    device = on;
    volume = std::move(of);
    device_info = on->info();
    grid = volume->grid();
    notices = volume->notices();
    maker_ = std::jthread([this, options](const std::stop_token &stop) { make(options, stop); });
  }

  Frame render(const FrameRequest &request) override {
    const std::lock_guard lock(turns_);
    return draw(request);
  }
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals) override {
    const std::lock_guard lock(turns_);
    return any_renderer().cast_rays(rays, isovalue, normals);
  }
  Camera camera(double isovalue, std::optional<ImageSize> size) override {
    const std::lock_guard lock(turns_);
    return any_renderer().camera(isovalue, size.value_or(size_));
  }
  /// What the device can; before ready(), this waits.
  bool can_draw(const FrameRequest &request) const override {
    return device_renderer().can_draw(request);
  }
  bool ready() const override { return done_; }
  bool ready_for(const FrameRequest &request) const override {
    return done_ || host_can_draw(request);
  }
  void wait() const override { device_renderer(); }
  void give_up() override { maker_.request_stop(); }
  std::string isovalue_notice(double isovalue) const override {
    return volume->isovalue_notice(isovalue);
  }
  std::uint64_t memory_bytes() const override { return done_ && made_ ? made_->memory_bytes() : 0; }
  double setup_ms() const override { return done_ && made_ ? made_->setup_ms() : 0; }

 private:
  void make(const RendererOptions &options, const std::stop_token &stop);
  Renderer &device_renderer() const;
  Renderer *host_renderer();
  Renderer &any_renderer();
  bool host_can_draw(const FrameRequest &request) const {
    return isowave::can_draw(request, core::HostRenderer::all_abilities(),
                             volume->implementation().volume);
  }
  Frame draw(const FrameRequest &request);

  ImageSize size_;  ///< of the largest picture
  HostRendererOptions host_options_;
  Turns turns_;                   ///< one frame at a time
  std::optional<Renderer> host_;  ///< from the first frame on that the host draws
  bool has_host_ = true;          ///< false: the volume cannot be drawn there
  // Written by the thread that makes the renderer, and read by others once done_ is true.
  mutable std::optional<Renderer> made_;
  std::exception_ptr failure_;
  std::atomic<bool> done_ = false;
  std::jthread maker_;  ///< the last member: it ends before the others go
};

void QuickImplementation::make(const RendererOptions &options, const std::stop_token &stop) {
  try {
    made_ = core::guarded("making a renderer", [&] {
      return Renderer(make_device_implementation(device, volume, options, [&stop] {
        if (stop.stop_requested()) throw core::Error("the renderer is no longer wanted");
      }));
    });
  } catch (...) {
    failure_ = std::current_exception();
  }
  done_ = true;
  done_.notify_all();
}

/// Waits for it.
Renderer &QuickImplementation::device_renderer() const {
  core::check_not_forked();
  done_.wait(false);
  if (failure_) std::rethrow_exception(failure_);
  return made_.value();
}

/// Null if the device's renderer is ready, or the host cannot draw the volume.
Renderer *QuickImplementation::host_renderer() {
  if (done_) {
    host_.reset();
    return nullptr;
  }
  if (!host_ && has_host_) {
    try {
      host_ = make_host_renderer(volume, host_options_);
    } catch (const Error &) {  // the limit; or a file, of which the device's renderer will tell
      has_host_ = false;
    }
  }
  return host_ ? &*host_ : nullptr;
}

Renderer &QuickImplementation::any_renderer() {
  Renderer *const on_host = host_renderer();
  return on_host != nullptr ? *on_host : device_renderer();
}

Frame QuickImplementation::draw(const FrameRequest &request) {
  Renderer *const on_host = host_can_draw(request) || done_ ? host_renderer() : nullptr;
  if (on_host == nullptr) return device_renderer().render(request);
  FrameRequest wanted = request;
  bool is_overtaken = false;
  wanted.on_pass = [&](const Progress &progress) {
    is_overtaken = done_;
    return !is_overtaken && (!request.on_pass || request.on_pass(progress));
  };
  Frame frame = on_host->render(wanted);
  return is_overtaken ? draw(request) : frame;
}

}  // namespace

Renderer make_quick_renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                             const RendererOptions &options,
                             const HostRendererOptions &host_options) {
  return core::guarded("making a renderer", [&] {
    if (!device || !volume) throw core::Error("a renderer needs a device and a volume");
    const core::ocl::Device &on = device->implementation().device;
    const core::CompressedVolume &compressed = volume->implementation().volume;
    core::make_plan(on, compressed,
                    core::checked(core_options(options, volume->num_levels()), compressed, on));
    return Renderer(
        std::make_unique<QuickImplementation>(device, std::move(volume), options, host_options));
  });
}

}  // namespace isowave
