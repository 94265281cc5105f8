#include "isowave/renderer.hpp"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <utility>

#include "core/api/convert.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/base/ms_since.hpp"
#include "core/frame/colors.hpp"
#include "core/frame/surface_camera.hpp"
#include "core/io/file_name.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

using core::guarded;

/// An appearance for the renderer's last frame: in layers, colours by a field are blended already.
core::Appearance of_last_frame(core::Appearance appearance, const core::Renderer &renderer) {
  if (!renderer.has_field_values()) appearance.color_by_field.reset();
  return appearance;
}

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
  Array<std::uint8_t> draw_picture() const override {
    const core::Appearance appearance = of_last_frame(appearance_, renderer_);
    return public_array(renderer_.fetch({.picture = true}, appearance).picture);
  }

  core::Renderer &renderer_;
  core::Appearance appearance_;
};

}  // namespace

Renderer::Implementation::Implementation(std::shared_ptr<Turns> turns,
                                         const core::CompressedVolume &of,
                                         std::unique_ptr<core::Renderer> renderer)
    : turns_(std::move(turns)), volume_(of), renderer_(std::move(renderer)) {
  note_memory();
}

Renderer::Implementation::Implementation(std::shared_ptr<Turns> turns,
                                         std::shared_ptr<const Volume> of,
                                         std::unique_ptr<core::Renderer> renderer)
    : Implementation(std::move(turns), of->implementation().volume, std::move(renderer)) {
  grid = of->grid();
  notices = of->notices();
  volume = std::move(of);
}

Renderer::Implementation::~Implementation() {
  const TurnOrMine turn(*turns_);
  renderer_.reset();
}

Frame Renderer::Implementation::render(const FrameRequest &request) {
  return guarded("rendering", [&] {
    const std::lock_guard lock(*turns_);
    return draw(request);
  });
}

Frame Renderer::Implementation::draw(const FrameRequest &request) {
  core::Team &team = renderer_->team();
  if (team.size() > 1) core::agree_on(team, "request", text_of(request));
  if (!ready_for(request)) wait();
  const auto begin = std::chrono::steady_clock::now();
  check_wanted(request, renderer_->abilities());
  core::FrameRequest wanted = core_request(request, volume_);
  ProgressOf progress(*renderer_, core_appearance(request, whole()));
  if (request.on_pass) {
    wanted.on_pass = [&](const core::PassStats &pass) {
      return progress.show(pass, request.on_pass);
    };
  }
  if (request.on_progress) {
    wanted.on_progress = [&, most = 0.0](double percent) mutable {
      request.on_progress(most = std::max(most, percent));
    };
  }
  last_ = {renderer_->render(wanted), {}};
  const core::FrameStats &stats = last_.stats;
  Frame frame;
  describe_frame(request, stats, frame);
  frame.statistics.errors_are_stated = volume_.errors_are_stated;
  note_memory();
  wanted = without_calls(std::move(wanted));
  if (stats.detail) {
    wanted = as_chosen(std::move(wanted), *stats.detail, renderer_->abilities().largest);
    if (team.rank() == 0) frame.detail = public_choice(*stats.detail);
  }
  fetch(request, frame);
  frame.statistics.total_ms = core::ms_since(begin);
  frame.statistics.hits = renderer_->num_hits(stats);
  if (request.want_bounds) {  // last, since it draws frames of its own
    const std::vector<float> depth =
        request.want_depth ? frame.depth.to_vector() : renderer_->depth();
    last_.certificate = core::certify(*renderer_, volume_, wanted, depth);
    frame.bounds = Array<float>(last_.certificate.bounds);
  }
  return frame;
}

namespace {

std::optional<std::array<double, 2>> range_of_colors(
    const core::Appearance &appearance, const std::optional<std::array<float, 2>> &field_range) {
  if (appearance.color_by) return std::array{appearance.color_by->low, appearance.color_by->high};
  if (!appearance.color_by_field || appearance.color_by_field->labels || !field_range)
    return std::nullopt;
  return std::array{appearance.color_by_field->low.value_or((*field_range)[0]),
                    appearance.color_by_field->high.value_or((*field_range)[1])};
}

}  // namespace

/// Gets what the request wants of the frame that was drawn, except bounds.
void Renderer::Implementation::fetch(const FrameRequest &request, Frame &frame) {
  const core::WantedArrays wanted{request.want_picture,   request.want_depth, request.want_normals,
                                  request.want_positions, request.want_field, request.want_hits};
  const core::Appearance appearance = core_appearance(request, whole());
  const auto range = renderer_->field_range();
  frame.statistics.color_range = range_of_colors(appearance, range);
  if (!request.slices.empty()) {
    const core::Slices slices =
        core_slices(request.slices, request.appearance, volume_.value_range);
    frame.statistics.slice_range = {slices.low, slices.high};
  }
  if (renderer_->has_field_values()) frame.statistics.field_range = range;
  // Without a picture, nothing needs colours, nor the values that they are by.
  core::FrameArrays arrays = renderer_->fetch(wanted, of_last_frame(appearance, *renderer_));
  if (request.want_hits)
    frame.hits = public_hits(std::span(arrays.hits.data(), arrays.hits.size()), volume_,
                             renderer_->abilities().levels, memory_);
  move_arrays(std::move(arrays), frame);
}

Frame Renderer::Implementation::cast_rays(std::span<const Ray> rays, double isovalue,
                                          Normals normals) {
  return guarded("casting rays", [&] {
    const std::lock_guard lock(*turns_);
    const std::vector<core::HitRecord> hits =
        renderer_->cast_rays(world_rays(rays), core::drawn_isovalue(volume_, isovalue),
                             static_cast<core::Normals>(normals));
    note_memory();
    return frame_of_rays(hits, volume_, renderer_->abilities().levels);
  });
}

std::vector<Camera> Renderer::Implementation::turntable(const std::vector<Surface> &surfaces,
                                                        std::uint32_t num_views,
                                                        std::optional<ImageSize> size,
                                                        const Viewpoint &from) {
  return guarded("looking for the surface", [&] {
    const core::Viewpoint viewpoint = core_viewpoint(from, num_views);
    const std::lock_guard lock(*turns_);
    const auto of = size ? std::optional(core_size(*size)) : std::nullopt;
    std::vector<double> isovalues(surfaces.size());
    std::ranges::transform(surfaces, isovalues.begin(), &Surface::isovalue);
    const std::vector<std::uint16_t> labels = labels_of(surfaces);
    const core::Camera first =
        surfaces.empty() ? box_camera(of.value_or(renderer_->abilities().largest), viewpoint)
        : labels.empty()
            ? renderer_->camera(core::drawn_isovalues(volume_, isovalues), of, viewpoint)
            : renderer_->label_camera(labels, of, viewpoint);
    return public_turntable(first, whole(), viewpoint);
  });
}

core::Camera Renderer::Implementation::box_camera(core::ImageSize size,
                                                  const core::Viewpoint &from) {
  core::check_image_size(size);
  return core::surface_camera(whole(), {}, size, from);
}

bool Renderer::Implementation::can_draw(const FrameRequest &request) const {
  return isowave::can_draw(request, renderer_->abilities(), volume_);
}

bool Renderer::Implementation::ready_for(const FrameRequest &request) const {
  return ready() || isowave::can_draw(request, soon->meanwhile_abilities(), volume_);
}

std::string Renderer::Implementation::isovalue_notice(double isovalue) const {
  return guarded("looking at an isovalue",
                 [&] { return core::isovalue_notice(volume_, isovalue); });
}

Renderer::Renderer(std::unique_ptr<Implementation> implementation)
    : implementation_(std::move(implementation)) {}

/// In a forked process all is left as it is: a driver would wait for its threads.
Renderer::~Renderer() {
  if (core::is_forked()) static_cast<void>(implementation_.release());
}
Renderer::Renderer(Renderer &&) noexcept = default;
Renderer &Renderer::operator=(Renderer &&other) noexcept {
  const Renderer old(std::move(*this));
  implementation_ = std::move(other.implementation_);
  return *this;
}

Frame Renderer::render(const FrameRequest &request) {
  return implementation_->render(request);
}
Frame Renderer::cast_rays(std::span<const Ray> rays, double isovalue, Normals normals) {
  return implementation_->cast_rays(rays, isovalue, normals);
}
Camera Renderer::camera(std::optional<ImageSize> size, const Viewpoint &from) {
  return turntable({}, 1, size, from).front();
}
Camera Renderer::camera(double isovalue, std::optional<ImageSize> size, const Viewpoint &from) {
  return implementation_->turntable({{.isovalue = isovalue}}, 1, size, from).front();
}
Camera Renderer::camera(const std::vector<Surface> &surfaces, std::optional<ImageSize> size,
                        const Viewpoint &from) {
  return turntable(surfaces, 1, size, from).front();
}
std::vector<Camera> Renderer::turntable(const std::vector<Surface> &surfaces,
                                        std::uint32_t num_views, std::optional<ImageSize> size,
                                        const Viewpoint &from) {
  return implementation_->turntable(surfaces, num_views, size, from);
}
bool Renderer::can_draw(const FrameRequest &request) const {
  return implementation_->can_draw(request);
}
bool Renderer::ready() const {
  return implementation_->ready();
}
bool Renderer::ready_for(const FrameRequest &request) const {
  return implementation_->ready_for(request);
}
void Renderer::wait() const {
  implementation_->wait();
}
void Renderer::give_up() {
  if (implementation_->soon != nullptr) implementation_->soon->give_up();
}
const std::shared_ptr<Device> &Renderer::device() const {
  return implementation_->device;
}
const std::shared_ptr<const Volume> &Renderer::volume() const {
  return implementation_->volume;
}
const DeviceInfo &Renderer::device_info() const {
  return implementation_->device_info;
}
const Grid &Renderer::grid() const {
  return implementation_->grid;
}
const std::vector<std::string> &Renderer::notices() const {
  return implementation_->notices;
}
std::string Renderer::isovalue_notice(double isovalue) const {
  return implementation_->isovalue_notice(isovalue);
}
std::uint64_t Renderer::memory_bytes() const {
  return implementation_->memory_bytes();
}
double Renderer::setup_ms() const {
  return implementation_->setup_ms();
}

namespace {

core::Image8 image_of(const Frame &frame) {
  const std::size_t num_pixels = std::size_t(frame.size.width) * frame.size.height;
  const std::uint32_t channels = frame.picture.size() == 4 * num_pixels ? 4 : 3;
  return {frame.size.width, frame.size.height, channels, frame.picture.to_vector()};
}

/// The frame's camera, as a camera file.
std::string cameras_of(const Frame &frame) {
  if (!frame.camera) return {};
  const ImageSize &size = frame.size;
  return core::camera_file_text({core_camera(*frame.camera)}, size.width, size.height);
}

}  // namespace

std::array<ClipPlane, 6> box_planes(const Vector3 &begin, const Vector3 &end) {
  return guarded("making a box", [&] {
    std::array<ClipPlane, 6> planes;
    std::ranges::transform(core::box_planes(to_glm(begin), to_glm(end)), planes.begin(),
                           [](const core::ClipPlane &plane) -> ClipPlane {
                             return {from_glm(plane.normal), plane.offset};
                           });
    return planes;
  });
}

std::array<float, 3> parse_color(std::string_view text) {
  return guarded("reading a colour", [&] { return from_glm(core::parse_color(text)); });
}

std::array<float, 3> surface_color(std::size_t index) {
  return from_glm(core::surface_color(index));
}

void save_png(const Frame &frame, const std::filesystem::path &path) {
  guarded("saving a picture", [&] {
    core::check_png_name(path);
    if (frame.picture.empty()) throw core::Error("{}: the frame has no picture", path.string());
    core::write_png(image_of(frame), path, cameras_of(frame));
  });
}

std::vector<std::uint8_t> encode_png(const Frame &frame) {
  return guarded("encoding a picture", [&] {
    if (frame.picture.empty()) throw core::Error("the frame has no picture");
    return core::encode_png(image_of(frame), cameras_of(frame));
  });
}

}  // namespace isowave
