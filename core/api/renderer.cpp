#include "isowave/renderer.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "core/accuracy/certify.hpp"
#include "core/accuracy/choose_detail.hpp"
#include "core/api/device_implementation.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/io/file_name.hpp"
#include "core/render/renderer.hpp"
#include "core/render/renderer_options.hpp"
#include "core/render/time_budget.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

using core::guarded;

core::RendererOptions core_options(const RendererOptions &options, const Volume &volume) {
  core::RendererOptions result;
  result.size = core_size(options.largest);
  result.memory_budget = options.memory_budget;
  result.cache_slots = options.cache_blocks;
  result.with_levels = options.with_levels && volume.num_levels() > 1;
  result.with_bounds = options.with_bounds;
  result.with_kept_picture = options.with_time_budget;
  result.with_given_rays = options.with_rays;
  return result;
}

}  // namespace

struct Renderer::Implementation {
  Implementation(std::shared_ptr<Device> device_used, std::shared_ptr<const Volume> volume_drawn,
                 const RendererOptions &renderer_options)
      : device(std::move(device_used)),
        volume(std::move(volume_drawn)),
        options(renderer_options),
        renderer(device->implementation().device, volume->implementation().volume,
                 core_options(options, *volume)) {
    if (options.with_time_budget) timed.emplace(renderer);
    note_memory();
  }

  /// For other threads, that may ask while a frame is drawn.
  void note_memory() { memory_bytes = renderer.memory_plan().total(); }

  Frame draw(const FrameRequest &request);
  void draw_hits(const FrameRequest &request, core::FrameRequest &wanted, Frame &frame);
  void fetch(const FrameRequest &request, const core::FrameRequest &drawn, Frame &frame);

  std::shared_ptr<Device> device;
  std::shared_ptr<const Volume> volume;
  RendererOptions options;
  core::Renderer renderer;
  std::optional<core::TimedFrames> timed;
  std::atomic<std::uint64_t> memory_bytes = 0;
};

namespace {

/// The frame at work, for on_pass.
class ProgressOf : public ProgressInTurns {
 public:
  ProgressOf(core::Renderer &renderer, const core::Appearance &appearance)
      : renderer_(renderer), appearance_(appearance) {}

 private:
  ImageSize current_size() const override {
    const core::ImageSize size = renderer_.size();
    return {size.width, size.height, size.samples};
  }
  std::vector<std::uint8_t> draw_picture() const override {
    return renderer_.shade(appearance_).pixels;
  }

  core::Renderer &renderer_;
  core::Appearance appearance_;
};

void check(const FrameRequest &request, const RendererOptions &options) {
  if (request.max_surface_error && request.time_budget_ms)
    throw core::Error("a frame cannot keep both an error and a time: give one of the two");
  check_bounds(request, options);
  if (request.time_budget_ms && !options.with_time_budget)
    throw core::Error("a time budget needs a renderer that was made with_time_budget");
  if (request.time_budget_ms && request.want_bounds)
    throw core::Error("a picture within a time has no bounds of its error: leave out want_bounds");
  if (request.ambient_rays != 0 && !options.with_rays)
    throw core::Error("ambient rays need a renderer that was made with_rays");
}

}  // namespace

/// Chooses the detail, or keeps to the time, where the request says so, and draws. wanted: becomes
/// the request as it was drawn.
void Renderer::Implementation::draw_hits(const FrameRequest &request, core::FrameRequest &wanted,
                                         Frame &frame) {
  ProgressOf progress(renderer, core_appearance(request.appearance));
  const core::OnPass on_pass = [&](const core::PassStats &pass) {
    return progress.show(pass, request.on_pass);
  };
  if (request.time_budget_ms) {
    if (request.on_pass) wanted.on_pass = on_pass;
    const core::TimedFrame drawn = timed.value().render(wanted, *request.time_budget_ms);
    wanted.on_pass = {};
    core::FrameStats stats = drawn.stats;
    stats.cancelled = drawn.stopped;
    describe_frame(request, stats, frame);
    frame.statistics.complete = drawn.complete;
    return;
  }
  if (request.max_surface_error) {
    const core::DetailChoice choice = core::choose_detail(renderer, volume->implementation().volume,
                                                          wanted, *request.max_surface_error);
    wanted = core::with_detail(wanted, choice.detail);
    frame.detail = public_choice(choice);
  }
  if (request.on_pass) wanted.on_pass = on_pass;
  describe_frame(request, renderer.render(wanted), frame);
  wanted.on_pass = {};
}

/// What the request wants of the frame that was drawn.
void Renderer::Implementation::fetch(const FrameRequest &request, const core::FrameRequest &drawn,
                                     Frame &frame) {
  const core::CompressedVolume &compressed = volume->implementation().volume;
  if (request.want_picture)
    frame.picture = renderer.shade(core_appearance(request.appearance)).pixels;
  if (!(request.want_depth || request.want_normals || request.want_positions || request.want_hits ||
        request.want_bounds))
    return;
  const std::vector<core::HitRecord> records = renderer.hits();
  fill_frame(request, records, compressed, renderer.options().with_levels, frame);
  if (request.want_bounds)
    frame.bounds = core::certify(renderer, compressed, drawn, records).bounds;
}

Frame Renderer::Implementation::draw(const FrameRequest &request) {
  check(request, options);
  core::FrameRequest wanted = core_request(request, volume->implementation().volume);
  Frame frame;
  draw_hits(request, wanted, frame);
  frame.statistics.errors_are_stated = volume->errors_are_stated();
  note_memory();
  fetch(request, wanted, frame);
  return frame;
}

Renderer::Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                   const RendererOptions &options)
    : Renderer(std::move(device), std::move(volume), options, {}) {}

Renderer::Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                   const RendererOptions &options, const std::function<void()> &before_kernel) {
  guarded("making a renderer", [&] {
    if (!device || !volume) throw core::Error("a renderer needs a device and a volume");
    const std::lock_guard lock(device->implementation().mutex);
    const KernelWatch watch(device->implementation().device, before_kernel);
    implementation_ = std::make_unique<Implementation>(device, std::move(volume), options);
  });
}

void Renderer::check_options(const Device &device, const Volume &volume,
                             const RendererOptions &options) {
  const core::ocl::Device &on = device.implementation().device;
  const core::CompressedVolume &compressed = volume.implementation().volume;
  core::make_plan(on, compressed, core::checked(core_options(options, volume), compressed, on));
}

Renderer::~Renderer() {
  release();
}
Renderer::Renderer(Renderer &&) noexcept = default;
Renderer &Renderer::operator=(Renderer &&other) noexcept {
  release();
  implementation_ = std::move(other.implementation_);
  return *this;
}

/// Buffers go while no other thread drives the device, which must outlive the lock. In a forked
/// process all is left as it is: a driver would wait for its threads.
void Renderer::release() noexcept {
  if (!implementation_) return;
  if (core::is_forked()) {
    static_cast<void>(implementation_.release());
    return;
  }
  const std::shared_ptr<Device> device = implementation_->device;
  const TurnOrMine turn(device->implementation().mutex);
  implementation_.reset();
}

Frame Renderer::render(const FrameRequest &request) {
  return guarded("rendering", [&] {
    const std::lock_guard lock(implementation_->device->implementation().mutex);
    return implementation_->draw(request);
  });
}

Frame Renderer::cast_rays(std::span<const Ray> rays, double isovalue, Normals normals) {
  return guarded("casting rays", [&] {
    if (!implementation_->options.with_rays)
      throw core::Error("rays of any origin need a renderer that was made with_rays");
    const std::lock_guard lock(implementation_->device->implementation().mutex);
    core::Renderer &renderer = implementation_->renderer;
    const core::CompressedVolume &compressed = volume()->implementation().volume;
    const std::vector<core::HitRecord> hits =
        renderer.cast_rays(world_rays(rays), core::drawn_isovalue(compressed, isovalue),
                           static_cast<core::Normals>(normals));
    implementation_->note_memory();
    return frame_of_rays(hits, compressed, renderer.options().with_levels);
  });
}

Camera Renderer::camera(double isovalue, std::optional<ImageSize> size) {
  return guarded("looking for the surface", [&] {
    const std::lock_guard lock(implementation_->device->implementation().mutex);
    const float drawn = core::drawn_isovalue(volume()->implementation().volume, isovalue);
    return public_camera(implementation_->renderer.camera(
        {&drawn, 1}, size ? std::optional(core_size(*size)) : std::nullopt));
  });
}

const std::shared_ptr<Device> &Renderer::device() const {
  return implementation_->device;
}
const std::shared_ptr<const Volume> &Renderer::volume() const {
  return implementation_->volume;
}
std::uint64_t Renderer::memory_bytes() const {
  return implementation_->memory_bytes;
}
double Renderer::setup_ms() const {
  return implementation_->renderer.setup_ms();
}

namespace {

core::Image8 image_of(const Frame &frame) {
  const std::size_t num_pixels = std::size_t(frame.size.width) * frame.size.height;
  const std::uint32_t channels = frame.picture.size() == 4 * num_pixels ? 4 : 3;
  return {frame.size.width, frame.size.height, channels, frame.picture};
}

}  // namespace

void save_png(const Frame &frame, const std::filesystem::path &path) {
  guarded("saving a picture", [&] {
    core::check_png_name(path);
    if (frame.picture.empty()) throw core::Error("{}: the frame has no picture", path.string());
    core::write_png(image_of(frame), path);
  });
}

std::vector<std::uint8_t> encode_png(const Frame &frame) {
  return guarded("encoding a picture", [&] {
    if (frame.picture.empty()) throw core::Error("the frame has no picture");
    return core::encode_png(image_of(frame));
  });
}

}  // namespace isowave
