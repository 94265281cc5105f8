// isowave._core: devices and renderers.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <thread>
#include <type_traits>

#include <isowave/page.hpp>

#include "module.hpp"
#include "requests.hpp"

namespace isowave_python {

namespace {

nb::dict device_dict(const isowave::DeviceInfo &info) {
  nb::dict result;
  result["index"] = info.index;
  result["name"] = info.name;
  result["vendor"] = info.vendor;
  result["platform"] = info.platform;
  result["driver"] = info.driver;
  result["type"] = info.type;
  result["memory_bytes"] = info.memory_bytes;
  return result;
}

/// [height][width][3], or [4] if it is transparent; [0][0][3] at ranks that get no picture.
nb::object picture_array(isowave::Array<std::uint8_t> &&pixels, const isowave::ImageSize &size) {
  if (pixels.empty()) return to_numpy<std::uint8_t>(std::move(pixels), {0, 0, 3});
  const std::size_t opaque = std::size_t{3} * size.width * size.height;
  const std::size_t channels = pixels.size() > opaque ? 4 : 3;
  return to_numpy<std::uint8_t>(std::move(pixels), {size.height, size.width, channels});
}

/// The picture so far; only while the callback that got it is at work. Threads take turns.
class PassView {
  /// A thread with the lock never waits for the GIL.
  template <class Look>
  auto look(const Look &at) const {
    const WithoutGil no_gil;
    const std::lock_guard lock(mutex_);
    if (progress_ == nullptr) throw Error("this pass is over: look at it within on_pass");
    return at(*progress_);
  }

 public:
  explicit PassView(const isowave::Progress &progress) : progress_(&progress) {}

  std::uint32_t passes() const {
    return look([](const isowave::Progress &progress) { return progress.passes(); });
  }
  double completed_percent() const {
    return look([](const isowave::Progress &progress) { return progress.completed_percent(); });
  }
  nb::object picture() const {
    isowave::ImageSize size;
    isowave::Array<std::uint8_t> pixels = look([&](const isowave::Progress &progress) {
      size = progress.size();
      return progress.picture();
    });
    return picture_array(std::move(pixels), size);
  }
  /// The callback is over. Waits for pictures of other threads.
  void end() {
    const WithoutGil no_gil;
    const std::lock_guard lock(mutex_);
    progress_ = nullptr;
  }

 private:
  mutable std::mutex mutex_;
  const isowave::Progress *progress_;
};

nb::dict statistics_dict(const isowave::FrameStatistics &statistics) {
  nb::dict result;
  result["passes"] = statistics.passes;
  result["rays"] = statistics.rays;
  result["hits"] = statistics.hits;
  result["decoded_blocks"] = statistics.decoded_blocks;
  result["normals_passes"] = statistics.normals_passes;
  result["normals_decoded_blocks"] = statistics.normals_decoded_blocks;
  result["normals_ms"] = statistics.normals_ms;
  result["ambient_passes"] = statistics.ambient_passes;
  result["ambient_ms"] = statistics.ambient_ms;
  result["field_ms"] = statistics.field_ms;
  result["field_range"] = nb::none();
  if (const auto &range = statistics.field_range)
    result["field_range"] = nb::make_tuple((*range)[0], (*range)[1]);
  result["color_range"] = nb::none();
  if (const auto &range = statistics.color_range)
    result["color_range"] = nb::make_tuple((*range)[0], (*range)[1]);
  result["slice_range"] = nb::none();
  if (const auto &range = statistics.slice_range)
    result["slice_range"] = nb::make_tuple((*range)[0], (*range)[1]);
  result["uploaded_bytes"] = statistics.uploaded_bytes;
  result["first_level"] = statistics.first_level;
  result["last_level"] = statistics.last_level;
  result["total_ms"] = statistics.total_ms;
  result["hits_ms"] = statistics.hits_ms;
  result["cancelled"] = statistics.cancelled;
  result["complete"] = statistics.complete;
  result["errors_are_stated"] = statistics.errors_are_stated;
  result["layers"] = statistics.layers;
  result["layer_hits"] = statistics.layer_hits;
  result["rays_cut"] = statistics.rays_cut;
  result["stage_ms"] = statistics.stage_ms;
  return result;
}

/// Adds frame.hits as cells [rows][columns][3], and [rows][columns] levels, surfaces, which are -1
/// if nothing is hit, and caps, which are 0 or 1.
void add_hits(const isowave::Frame &frame, nb::dict &result) {
  std::vector<Index3> cells;
  std::vector<std::uint32_t> levels;
  std::vector<std::int8_t> surfaces;
  std::vector<std::uint8_t> caps;
  for (const isowave::Hit &hit : frame.hits) {
    cells.push_back(hit.cell);
    levels.push_back(hit.level);
    surfaces.push_back(std::isinf(hit.t) ? std::int8_t{-1} : std::int8_t(hit.surface));
    caps.push_back(hit.cap ? 1 : 0);
  }
  result["surfaces"] = to_numpy<std::int8_t>(std::move(surfaces), {frame.rows, frame.columns});
  result["caps"] = to_numpy<std::uint8_t>(std::move(caps), {frame.rows, frame.columns});
  result["cells"] = to_numpy<std::uint32_t>(std::move(cells), {frame.rows, frame.columns, 3});
  result["levels"] = to_numpy<std::uint32_t>(std::move(levels), {frame.rows, frame.columns});
}

/// is_of_rays: arrays are there even if they are empty.
nb::dict frame_dict(isowave::Frame &&frame, bool is_of_rays = false) {
  nb::dict result;
  const std::size_t rows = frame.rows, columns = frame.columns;
  if (!frame.picture.empty())
    result["picture"] = picture_array(std::move(frame.picture), frame.size);
  if (is_of_rays || !frame.depth.empty())
    result["depth"] = to_numpy<float>(std::move(frame.depth), {rows, columns});
  if (is_of_rays || !frame.normals.empty())
    result["normals"] = to_numpy<float>(std::move(frame.normals), {rows, columns, 3});
  if (is_of_rays || !frame.positions.empty())
    result["positions"] = to_numpy<double>(std::move(frame.positions), {rows, columns, 3});
  if (!frame.field.empty())
    result["field"] = to_numpy<float>(std::move(frame.field), {rows, columns});
  if (!frame.bounds.empty())
    result["bounds"] = to_numpy<float>(std::move(frame.bounds), {rows, columns});
  if (is_of_rays || !frame.hits.empty()) add_hits(frame, result);
  nb::dict statistics = statistics_dict(frame.statistics);
  if (frame.detail) {
    nb::dict detail;
    detail["voxel_pixels"] = frame.detail->voxel_pixels;
    detail["voxel_error"] = frame.detail->voxel_error;
    detail["reachable"] = frame.detail->reachable;
    detail["advice"] = frame.detail->advice;
    if (const auto &sample = frame.detail->sample) {
      detail["sampled_rays"] = sample->num_rays;
      detail["sampled_hits"] = sample->num_hits;
      detail["within"] = sample->num_within;
      detail["lowest_share"] = sample->lowest;
    }
    if (const auto &image = frame.detail->image) {
      detail["samples"] = image->samples;
      detail["tiles"] = image->num_tiles;
      detail["flip"] = image->mean;
      detail["highest_flip"] = image->highest;
    }
    statistics["detail"] = detail;
  }
  result["statistics"] = statistics;
  return result;
}

/// [count][6]
using RayArray = nb::ndarray<double, nb::ro, nb::shape<-1, 6>, nb::c_contig>;

/// A renderer that is no longer wanted while it is being made. A thread of its own waits for the
/// kernel that is being compiled. A process that ends before leaves the compiler as it is.
void abandon(std::unique_ptr<isowave::Renderer> renderer) {
  static std::atomic<int> num_abandoned = 0;
  static const int ends_at_once = ::on_exit(
      [](int status, void *) {
        if (num_abandoned == 0) return;
        std::fflush(nullptr);
        ::_exit(status);
      },
      nullptr);
  static_cast<void>(ends_at_once);
  renderer->give_up();
  ++num_abandoned;
  std::thread([left = std::move(renderer)]() mutable {
    left.reset();
    --num_abandoned;
  }).detach();
}

/// A Python object with rank, size, local_rank, all_gather() and reduce(): see _bricks.py.
class PyProcesses : public isowave::Processes {
 public:
  explicit PyProcesses(const nb::object &object)
      : object_(object),
        rank_(nb::cast<std::uint32_t>(object.attr("rank"))),
        size_(nb::cast<std::uint32_t>(object.attr("size"))),
        local_rank_(nb::cast<std::uint32_t>(object.attr("local_rank"))) {}

  std::uint32_t rank() const override { return rank_; }
  std::uint32_t size() const override { return size_; }
  std::uint32_t local_rank() const override { return local_rank_; }
  std::vector<std::string> all_gather(const std::string &bytes) override {
    std::vector<std::string> all;
    call([&] {
      for (const nb::handle each :
           object_.attr("all_gather")(nb::bytes(bytes.data(), bytes.size())))
        all.emplace_back(nb::cast<nb::bytes>(each).c_str(), nb::cast<nb::bytes>(each).size());
    });
    return all;
  }
  void reduce(std::span<std::uint64_t> words, Reduction how, bool for_all) override {
    call([&] {
      const bool in_halves = how == Reduction::kMinOfHalves;
      const nb::ndarray<nb::numpy> array(
          words.data(), {(in_halves ? 2 : 1) * words.size()}, nb::handle(), {},
          in_halves ? nb::dtype<std::uint32_t>() : nb::dtype<std::uint64_t>());
      object_.attr("reduce")(nb::cast(array, nb::rv_policy::reference), how != Reduction::kOr,
                             for_all);
    });
  }

  /// Calls work(callbacks), which calls these, without the GIL, and raises what they have raised.
  template <class Work>
  auto without_gil(const Work &work) {
    callbacks_ = {};
    return callbacks_.without_gil([&] { return work(callbacks_); });
  }

 private:
  template <class Work>
  void call(const Work &work) {
    if (!callbacks_.run(work)) throw Stopped();
  }

  nb::object object_;
  std::uint32_t rank_, size_, local_rank_;
  Callbacks callbacks_;
};

/// Calls on_pass, if there is one, with a view of the picture so far. Returns whether the frame
/// goes on.
bool show_pass(Callbacks &callbacks, const std::optional<nb::callable> &on_pass,
               const isowave::Progress &progress) {
  bool wanted = true;
  const bool goes_on = callbacks.run([&] {
    if (!on_pass) return;
    auto *const view = new PassView(progress);
    const nb::object owner = nb::cast(view, nb::rv_policy::take_ownership);
    try {
      wanted = nb::cast<bool>(call(*on_pass, owner));
    } catch (...) {
      view->end();
      throw;
    }
    view->end();
  });
  return goes_on && wanted;
}

/// Any of the library's renderers.
class PyRenderer {
  /// Calls work(callbacks) without the GIL, and raises what a callback has raised.
  template <class Work>
  auto without_gil(const Work &work) {
    if (processes_) return processes_->without_gil(work);
    Callbacks callbacks;
    return callbacks.without_gil([&] { return work(callbacks); });
  }

 public:
  using Owned = std::unique_ptr<isowave::Renderer, DestroyWithoutGil<isowave::Renderer>>;

  /// Draws on a device or on the host, see isowave::make_renderer(). A device's renderer with the
  /// option "quick" draws on the host until kernels are compiled.
  static std::unique_ptr<PyRenderer> make(const std::string &selector, const PyVolume &volume,
                                          const nb::dict &options) {
    isowave::RendererOptions wanted = renderer_options_of(options);
    if (options.contains("field") && !options["field"].is_none())
      wanted.field = nb::cast<const PyVolume &>(options["field"]).volume;
    const auto get = reader_of(options);
    isowave::DeviceOptions device_options;
    get("profiling", device_options.profiling);
    bool quick = false;
    get("quick", quick);
    auto result = std::make_unique<PyRenderer>();
    {
      const WithoutGil no_gil;
      result->renderer_.reset(new isowave::Renderer(
          isowave::make_renderer(volume.volume, wanted, selector, device_options)));
      PythonsEnd::instance().begin_making(*result->renderer_);
    }
    if (quick) return result;
    try {
      result->wait();
    } catch (...) {
      PythonsEnd::instance().end_making(*result->renderer_);
      if (!result->ready())
        abandon(std::unique_ptr<isowave::Renderer>(result->renderer_.release()));
      throw;
    }
    return result;
  }
  static std::unique_ptr<PyRenderer> on_host(const PyVolume &volume, std::uint64_t memory_limit) {
    auto result = std::make_unique<PyRenderer>();
    const WithoutGil no_gil;
    result->renderer_.reset(new isowave::Renderer(
        isowave::make_host_renderer(volume.volume, {.memory_limit = memory_limit})));
    return result;
  }
  static std::unique_ptr<PyRenderer> of_team(const nb::object &processes,
                                             const std::filesystem::path &path,
                                             const nb::dict &compression, const nb::dict &options) {
    isowave::BrickOptions wanted;
    const auto get = reader_of(options);
    get("device", wanted.device);
    get("bricks", wanted.bricks);
    get("field", wanted.field);
    wanted.renderer = renderer_options_of(options);
    const isowave::Compression how = compression_of(compression);
    auto result = std::make_unique<PyRenderer>();
    result->processes_ = std::make_unique<PyProcesses>(processes);
    result->without_gil([&](Callbacks &) {
      result->renderer_.reset(new isowave::Renderer(
          isowave::make_team_renderer(*result->processes_, path, how, {}, wanted)));
    });
    return result;
  }

  PyRenderer() = default;
  ~PyRenderer() {
    if (renderer_) PythonsEnd::instance().end_making(*renderer_);
  }
  PyRenderer(const PyRenderer &) = delete;
  PyRenderer &operator=(const PyRenderer &) = delete;

  /// on_pass     called after each pass with a PassView; False from it ends the frame
  /// progress    called ten times a second with the part of the frame that is done, 0 to 1
  /// interrupts  signals are looked for after each pass, which waits for that
  nb::dict render(const nb::dict &options, const std::optional<nb::callable> &on_pass,
                  const std::optional<nb::callable> &progress, bool interrupts) {
    isowave::FrameRequest request = request_of(options);
    if (!renderer_->ready_for(request)) wait();
    isowave::Frame frame = without_gil([&](Callbacks &callbacks) {
      if (progress) {
        request.on_progress = [&, last = std::chrono::steady_clock::now()](double percent) mutable {
          const auto now = std::chrono::steady_clock::now();
          if (now - last < std::chrono::milliseconds(100)) return;
          last = now;
          callbacks.run([&] { call(*progress, percent / 100); });
        };
      }
      if (on_pass || interrupts) {
        request.on_pass = [&](const isowave::Progress &progress) {
          return show_pass(callbacks, on_pass, progress);
        };
      }
      return renderer_->render(request);
    });
    return frame_dict(std::move(frame));
  }

  /// rays [count][6]: origin and direction.
  nb::dict cast_rays(const RayArray &rays, double isovalue, const std::string &normals) {
    static_assert(sizeof(isowave::Ray) == 6 * sizeof(double));
    const auto *first = reinterpret_cast<const isowave::Ray *>(rays.data());
    return frame_dict(
        without_gil([&](Callbacks &) {
          return renderer_->cast_rays({first, rays.shape(0)}, isovalue, normals_of(normals));
        }),
        true);
  }

  /// Surfaces of isovalues, or the surface of labels.
  static std::vector<isowave::Surface> surfaces_of(const std::vector<double> &values, bool labels) {
    std::vector<isowave::Surface> surfaces(labels ? 1 : 0);
    for (const double value : values) {
      if (labels) surfaces[0].labels.push_back(static_cast<std::uint32_t>(value));
      if (!labels) surfaces.push_back({.isovalue = value});
    }
    return surfaces;
  }

  std::vector<nb::tuple> turntable(const std::vector<double> &values, std::uint32_t num_views,
                                   std::uint32_t width, std::uint32_t height, bool labels) {
    const std::vector<isowave::Surface> surfaces = surfaces_of(values, labels);
    const std::vector<isowave::Camera> cameras = without_gil([&](Callbacks &) {
      return renderer_->turntable(surfaces, num_views, isowave::ImageSize{width, height, 1});
    });
    std::vector<nb::tuple> result;
    for (const isowave::Camera &camera : cameras) result.push_back(camera_tuple(camera));
    return result;
  }

  bool ready() const { return renderer_->ready(); }
  /// Until the device's renderer is made. Ctrl-C ends the wait.
  void wait() const {
    for (std::chrono::microseconds pause{200}; !renderer_->ready();) {
      {
        const WithoutGil no_gil;
        std::this_thread::sleep_for(pause);
      }
      if (PyErr_CheckSignals() != 0) throw nb::python_error();
      pause = std::min(pause * 5 / 4, std::chrono::microseconds{20'000});
    }
    const WithoutGil no_gil;
    renderer_->wait();
  }
  nb::dict device() const {
    nb::dict result = device_dict(renderer_->device_info());
    result["notice"] = renderer_->device() ? renderer_->device()->notice() : std::string();
    return result;
  }
  const isowave::Renderer &renderer() const { return *renderer_; }

 private:
  std::unique_ptr<PyProcesses>
      processes_;  ///< a team's; the renderer does not call it when it goes
  Owned renderer_;
};

std::vector<nb::dict> list_devices() {
  std::vector<isowave::DeviceInfo> infos;
  {
    const WithoutGil no_gil;
    infos = isowave::list_devices();
  }
  std::vector<nb::dict> result;
  for (const isowave::DeviceInfo &info : infos) result.push_back(device_dict(info));
  return result;
}

}  // namespace

void add_renderers(nb::module_ &m) {
  m.def("devices", &list_devices);
  m.def(
      "parse_color", [](const std::string &text) { return isowave::parse_color(text); }, "text"_a);
  m.def("surface_color", &isowave::surface_color, "index"_a);
  m.def("color_map_names", &isowave::color_map_names);
  m.def(
      "read_scene",
      [](const std::filesystem::path &path) { return dict_of(isowave::read_scene(path)); },
      "path"_a);
  m.def(
      "parse_scene", [](const std::string &text) { return dict_of(isowave::parse_scene(text)); },
      "text"_a);
  m.def(
      "write_scene",
      [](const nb::dict &scene, const std::filesystem::path &path) {
        isowave::write_scene(scene_of(scene), path);
      },
      "scene"_a, "path"_a);
  nb::class_<PassView>(m, "PassView")
      .def_prop_ro("passes", &PassView::passes)
      .def_prop_ro("completed_percent", &PassView::completed_percent)
      .def("picture", &PassView::picture);
  nb::class_<PyRenderer>(m, "Renderer")
      .def("render", &PyRenderer::render, "request"_a, "on_pass"_a.none(), "progress"_a.none(),
           "interrupts"_a)
      .def("cast_rays", &PyRenderer::cast_rays, "rays"_a, "isovalue"_a, "normals"_a)
      .def("turntable", &PyRenderer::turntable, "values"_a, "num_views"_a, "width"_a, "height"_a,
           "labels"_a = false)
      .def(
          "isovalue_notice",
          [](const PyRenderer &r, double isovalue) {
            return r.renderer().isovalue_notice(isovalue);
          },
          "isovalue"_a)
      .def("wait", &PyRenderer::wait)
      .def_prop_ro("ready", &PyRenderer::ready)
      .def_prop_ro("device", &PyRenderer::device)
      .def_prop_ro("memory_bytes", [](const PyRenderer &r) { return r.renderer().memory_bytes(); })
      .def_prop_ro("notices", [](const PyRenderer &r) { return r.renderer().notices(); })
      .def_prop_ro("dims", [](const PyRenderer &r) { return r.renderer().grid().dims; })
      .def_prop_ro("spacing", [](const PyRenderer &r) { return r.renderer().grid().spacing; })
      .def_prop_ro("origin", [](const PyRenderer &r) { return r.renderer().grid().origin; })
      .def_prop_ro("direction", [](const PyRenderer &r) { return r.renderer().grid().direction; })
      .def_prop_ro("is_anatomical",
                   [](const PyRenderer &r) { return r.renderer().grid().is_anatomical; });
  m.def(
      "draws_on_host",
      [](const std::string &selector) {
        const WithoutGil no_gil;
        return isowave::draws_on_host(selector);
      },
      "device"_a);
  m.def("make_renderer", &PyRenderer::make, "device"_a, "volume"_a, "options"_a);
  m.def("host_renderer", &PyRenderer::on_host, "volume"_a, "memory_limit"_a);
  m.def("team_renderer", &PyRenderer::of_team, "processes"_a, "path"_a, "compression"_a,
        "options"_a);
}

}  // namespace isowave_python
