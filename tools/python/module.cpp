// isowave._core: the library of core/api as a Python module. Axes are x, y, z here, as in C++; the
// Python files beside this one turn them into z, y, x and have the documentation.
//
// The GIL is released wherever the library works. What waits for a device's lock must not hold the
// GIL, since the thread that has the lock may wait for the GIL to report a pass; that goes for
// destructors, too.
//
// When Python ends, its daemon threads go on. One that asks for the GIL then is ended within C++,
// which aborts the process; one that still draws crashes in drivers that are gone. See PythonsEnd.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cxxabi.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <isowave/isowave.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using isowave::Error;
using isowave::Vector3;
using Index3 = std::array<std::uint32_t, 3>;
using Color = std::array<float, 3>;

/// A numpy array that owns the vector's values. T may be an array of numbers: then `shape` has its
/// length, too.
template <class Number, class T>
nb::object to_numpy(std::vector<T> &&values, std::initializer_list<std::size_t> shape) {
  auto owned = std::make_unique<std::vector<T>>(std::move(values));
  auto *data = reinterpret_cast<Number *>(owned->data());
  const nb::capsule owner(owned.release(),
                          [](void *held) noexcept { delete static_cast<std::vector<T> *>(held); });
  return nb::cast(nb::ndarray<nb::numpy, Number>(data, shape, owner));
}

/// get(name, field): reads an option that is there and not None into the field.
auto reader_of(const nb::dict &options) {
  return [&options](const char *name, auto &field) {
    if (options.contains(name) && !options[name].is_none())
      field = nb::cast<std::decay_t<decltype(field)>>(options[name]);
  };
}

/// Lets the library's work in other threads come to an end before Python does: frames after the
/// pass at hand, compression after the layer, renderers after the kernel. A thread that was at it
/// never returns to Python.
class PythonsEnd {
 public:
  static PythonsEnd &instance() {
    static auto *end = new PythonsEnd;  // threads may need it for as long as the process lives
    return *end;
  }

  /// Whether work is to stop.
  bool is_near() {
    const std::lock_guard lock(mutex_);
    return is_near_ && !is_own();
  }
  /// Called with the GIL, by Python, before it ends. Waits for work without callbacks, and for a
  /// second at most for callbacks.
  void come() {
    const nb::gil_scoped_release no_gil;
    std::unique_lock lock(mutex_);
    ending_thread_ = std::this_thread::get_id();
    is_near_ = true;
    for (isowave::Renderer *renderer : being_made_) renderer->give_up();
    if (process_ != ::getpid()) {  // a forked one, without the threads that are counted
      is_over_ = true;
      return;
    }
    const auto latest = std::chrono::steady_clock::now() + std::chrono::seconds(1);
    changed_.wait_until(lock, latest, [&] { return num_working_ == 0 && num_in_callbacks_ == 0; });
    changed_.wait(lock, [&] { return num_working_ == 0; });
    for (isowave::Renderer *renderer : being_made_) {
      try {
        renderer->wait();
      } catch (const Error &) {  // it was given up
      }
    }
    is_over_ = true;
  }

  /// The library begins to work in this thread, which has left the GIL. May not return.
  void begin_work() {
    std::unique_lock lock(mutex_);
    if (is_over_ || (is_near_ && callback_depth() == 0)) stay_if_foreign(lock);
    ++num_working_;
  }
  /// The work is done, and the thread is going to take the GIL. May not return.
  void before_gil() {
    std::unique_lock lock(mutex_);
    if (!is_near_ || is_own() || (callback_depth() > 0 && !is_over_)) return;
    --num_working_;
    changed_.notify_all();
    stay_if_foreign(lock);
  }
  /// The thread has the GIL.
  void end_work() {
    const std::lock_guard lock(mutex_);
    --num_working_;
    changed_.notify_all();
  }

  /// The library's work calls Python's code, with the GIL.
  void begin_callback() {
    const std::lock_guard lock(mutex_);
    --num_working_, ++num_in_callbacks_, ++callback_depth();
    changed_.notify_all();
  }
  /// Back in the library's work, still with the GIL. May not return.
  void end_callback() {
    std::unique_lock lock(mutex_);
    --num_in_callbacks_, --callback_depth();
    if (is_over_ && !is_own()) {
      PyEval_SaveThread();
      stay_if_foreign(lock);
    }
    ++num_working_;
  }
  /// Keeps this thread, which Python wants to end within a callback, for as long as the process
  /// lives: C++ cannot be left so.
  [[noreturn]] static void stay() {
    for (;;) ::pause();
  }

  void begin_making(isowave::Renderer &renderer) {
    const std::lock_guard lock(mutex_);
    being_made_.insert(&renderer);
    if (is_near_) renderer.give_up();
  }
  void end_making(isowave::Renderer &renderer) {
    const std::lock_guard lock(mutex_);
    being_made_.erase(&renderer);
  }

 private:
  bool is_own() const { return ending_thread_ == std::this_thread::get_id(); }
  static int &callback_depth() {
    thread_local int depth = 0;
    return depth;
  }
  void stay_if_foreign(std::unique_lock<std::mutex> &lock) {
    if (is_own()) return;
    lock.unlock();
    stay();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  const pid_t process_ = ::getpid();
  std::thread::id ending_thread_;
  bool is_near_ = false, is_over_ = false;
  int num_working_ = 0;  ///< threads that work without the GIL, or wait for it afterwards
  int num_in_callbacks_ = 0;
  std::set<isowave::Renderer *> being_made_;
};

/// The library works in this thread without the GIL.
class WithoutGil {
 public:
  WithoutGil() : state_(PyEval_SaveThread()) { PythonsEnd::instance().begin_work(); }
  ~WithoutGil() {
    PythonsEnd::instance().before_gil();
    PyEval_RestoreThread(state_);
    PythonsEnd::instance().end_work();
  }
  WithoutGil(const WithoutGil &) = delete;
  WithoutGil &operator=(const WithoutGil &) = delete;

 private:
  PyThreadState *state_;
};

/// Python's code runs in this thread, which is at the library's work.
class InCallback {
 public:
  InCallback() { PythonsEnd::instance().begin_callback(); }
  ~InCallback() { PythonsEnd::instance().end_callback(); }
  InCallback(const InCallback &) = delete;
  InCallback &operator=(const InCallback &) = delete;

 private:
  nb::gil_scoped_acquire gil_;
};

/// Calls a function of Python's.
template <class... Args>
nb::object call(const nb::callable &function, const Args &...args) {
  try {
    return function(args...);
  } catch (const abi::__forced_unwind &) {  // Python has ended
    PythonsEnd::stay();
  }
}

/// Keeps the first exception of Python's that a callback raises, since the library makes an Error
/// of what leaves a callback, and raises it again when the library has returned.
class Callbacks {
 public:
  /// Calls work() with the GIL held. Returns false where that, or an earlier callback, has raised
  /// something, or a signal came (Ctrl-C).
  template <class Work>
  bool run(const Work &work) {
    if (PythonsEnd::instance().is_near()) return false;
    const InCallback callback;
    if (raised_) return false;
    try {
      work();
      if (PyErr_CheckSignals() != 0) throw nb::python_error();
    } catch (...) {
      raised_ = std::current_exception();
    }
    return !raised_;
  }
  /// Calls work() without the GIL, and raises what a callback has raised.
  template <class Work>
  auto without_gil(const Work &work) {
    const auto work_alone = [&] {
      const WithoutGil no_gil;
      return work();
    };
    try {
      if constexpr (std::is_void_v<decltype(work())>) {
        work_alone();
        raise_again();
        return;
      } else {
        auto result = work_alone();
        raise_again();
        return result;
      }
    } catch (...) {
      if (!raised_) throw;
    }
    std::rethrow_exception(raised_);
  }

 private:
  void raise_again() const {
    if (raised_) std::rethrow_exception(raised_);
  }

  std::exception_ptr raised_;
};

/// What ends the library's work after a callback has raised something.
struct Stopped {};

/// Destroys T without the GIL.
template <class T>
struct DestroyWithoutGil {
  void operator()(T *object) const {
    const WithoutGil no_gil;
    delete object;
  }
};

// ---- Volumes ----

/// In the order of isowave::VoxelType.
constexpr std::array kTypeNames = {"uint8", "int8",    "uint16",  "int16",  "uint32",
                                   "int32", "float32", "float64", "uint64", "int64"};

isowave::VoxelType voxel_type(const std::string &name) {
  const auto found = std::ranges::find(kTypeNames, name);
  if (found == kTypeNames.end()) throw Error("voxels of type " + name + " are not supported");
  return static_cast<isowave::VoxelType>(found - kTypeNames.begin());
}

std::string type_name(isowave::VoxelType type) {
  return kTypeNames.at(static_cast<std::size_t>(type));
}

isowave::Compression compression_of(const nb::dict &options) {
  isowave::Compression result;
  const auto get = reader_of(options);
  get("rate", result.rate);
  get("tolerance", result.tolerance);
  get("relative_tolerance", result.relative_tolerance);
  get("exact", result.exact);
  get("measure_error", result.measure_error);
  get("levels", result.levels);
  get("map_nan", result.map_nan);
  get("no_data", result.no_data);
  get("num_threads", result.num_threads);
  return result;
}

/// Reports to `progress`, if there is one, and looks for signals.
void report_to(Callbacks &callbacks, const std::optional<nb::callable> &progress,
               isowave::Compression &compression) {
  compression.progress = [&callbacks, &progress](std::string_view what, double done) {
    const bool goes_on = callbacks.run([&] {
      if (progress) call(*progress, std::string(what), done);
    });
    if (!goes_on) throw Stopped();
  };
}

struct PyVolume {
  std::shared_ptr<const isowave::Volume> volume;
};

PyVolume compress(const nb::callable &read, const std::string &type, const Index3 &dims,
                  const Vector3 &spacing, const Vector3 &origin,
                  const std::array<Vector3, 3> &direction, const nb::dict &options, bool keep,
                  const std::optional<std::filesystem::path> &path,
                  const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::Compression compression = compression_of(options);
  report_to(callbacks, progress, compression);
  const auto read_layers = [&](std::uint32_t z, std::uint32_t num_layers,
                               std::span<std::byte> out) {
    const bool goes_on = callbacks.run([&] {
      const auto layers = nb::cast<nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu>>(
          call(read, z, z + num_layers));
      if (layers.nbytes() != out.size()) {
        throw Error("a source gave " + std::to_string(layers.nbytes()) + " bytes for layers of " +
                    std::to_string(out.size()));
      }
      std::memcpy(out.data(), layers.data(), out.size());
    });
    if (!goes_on) throw Stopped();
  };
  return callbacks.without_gil([&] {
    const isowave::Grid grid{dims, spacing, origin, direction};
    const isowave::ReadLayers read_all = read_layers;
    const isowave::VoxelType voxels = voxel_type(type);
    return PyVolume{
        path ? isowave::compress_to_file(read_all, voxels, grid, *path, compression, keep)
             : isowave::compress(read_all, voxels, grid, compression, keep)};
  });
}

PyVolume compress_array(const nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu> &array,
                        const std::string &type, const Index3 &dims, const Vector3 &spacing,
                        const Vector3 &origin, const std::array<Vector3, 3> &direction,
                        const nb::dict &options, const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::Compression compression = compression_of(options);
  report_to(callbacks, progress, compression);
  const isowave::Grid grid{dims, spacing, origin, direction};
  isowave::check_num_voxels(array.size(), grid);
  return callbacks.without_gil([&] {
    return PyVolume{isowave::compress(array.data(), voxel_type(type), grid, compression)};
  });
}

PyVolume open_volume(const std::filesystem::path &path, const nb::dict &options,
                     const std::optional<Index3> &dims, const std::optional<std::string> &type,
                     const std::optional<Vector3> &spacing,
                     const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::Compression compression = compression_of(options);
  report_to(callbacks, progress, compression);
  isowave::RawFile raw{dims, {}, spacing};
  if (type) raw.type = voxel_type(*type);
  return callbacks.without_gil(
      [&] { return PyVolume{isowave::open_volume(path, compression, raw)}; });
}

nb::object decode(const PyVolume &self, std::uint32_t level, const Index3 &begin, const Index3 &end,
                  const Index3 &step) {
  std::vector<float> voxels;
  {
    const WithoutGil no_gil;
    voxels = self.volume->decode(level, {begin, end, step});
  }
  const auto count = [&](std::size_t axis) -> std::size_t {
    return (end.at(axis) - begin.at(axis) - 1) / step.at(axis) + 1;
  };
  return to_numpy<float>(std::move(voxels), {count(2), count(1), count(0)});
}

nb::object sample(const PyVolume &self, std::uint64_t max_voxels) {
  std::vector<float> voxels;
  {
    const WithoutGil no_gil;
    voxels = self.volume->sample(max_voxels);
  }
  const std::size_t count = voxels.size();
  return to_numpy<float>(std::move(voxels), {count});
}

// ---- Meshes ----

nb::dict extract(const PyVolume &self, const std::string &device, double isovalue,
                 std::uint32_t level, bool normals, bool exact_vertices,
                 std::uint64_t memory_budget, const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::ExtractOptions options{
      .level = level,
      .with_normals = normals,
      .vertices = exact_vertices ? isowave::VertexPlaces::kExact : isowave::VertexPlaces::kApart,
      .memory_budget = memory_budget};
  options.progress = [&](std::string_view what, double done) {
    const bool goes_on = callbacks.run([&] {
      if (progress) call(*progress, std::string(what), done);
    });
    if (!goes_on) throw Stopped();
  };
  isowave::Mesh mesh = callbacks.without_gil([&] {
    return isowave::extract(isowave::open_device(device), self.volume, isovalue, options);
  });
  nb::dict result;
  const std::size_t num_vertices = mesh.vertices.size(), num_faces = mesh.triangles.size();
  result["vertices"] = to_numpy<double>(std::move(mesh.vertices), {num_vertices, 3});
  result["faces"] = to_numpy<std::uint32_t>(std::move(mesh.triangles), {num_faces, 3});
  if (normals) result["normals"] = to_numpy<float>(std::move(mesh.normals), {num_vertices, 3});
  return result;
}

/// values [count][3]
template <class T>
using Rows = nb::ndarray<T, nb::ro, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

template <class T>
std::vector<std::array<T, 3>> to_vector(const Rows<T> &rows) {
  std::vector<std::array<T, 3>> result(rows.shape(0));
  if (!result.empty()) std::memcpy(result.data(), rows.data(), rows.nbytes());
  return result;
}

std::string save_mesh(const Rows<double> &vertices, const Rows<std::uint32_t> &faces,
                      const std::optional<Rows<float>> &normals,
                      const std::filesystem::path &path) {
  const isowave::Mesh mesh{
      .vertices = to_vector(vertices),
      .normals = normals ? to_vector(*normals) : std::vector<std::array<float, 3>>{},
      .triangles = to_vector(faces)};
  const WithoutGil no_gil;
  return isowave::save_mesh(mesh, path);
}

// ---- Devices and renderers ----

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

nb::tuple camera_tuple(const isowave::Camera &camera) {
  const auto vector = [](const Vector3 &v) { return nb::make_tuple(v[0], v[1], v[2]); };
  return nb::make_tuple(vector(camera.eye), vector(camera.at), vector(camera.up),
                        camera.fovy_degrees);
}

/// The picture so far; only while the callback that got it is at work. Threads take turns.
class PassView {
  /// Who has the lock never waits for the GIL.
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
    std::vector<std::uint8_t> pixels = look([&](const isowave::Progress &progress) {
      size = progress.size();
      return progress.picture();
    });
    return to_numpy<std::uint8_t>(std::move(pixels), {size.height, size.width, 3});
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
  result["uploaded_bytes"] = statistics.uploaded_bytes;
  result["first_level"] = statistics.first_level;
  result["last_level"] = statistics.last_level;
  result["total_ms"] = statistics.total_ms;
  result["cancelled"] = statistics.cancelled;
  result["complete"] = statistics.complete;
  result["errors_are_stated"] = statistics.errors_are_stated;
  result["stage_ms"] = statistics.stage_ms;
  return result;
}

/// Of frame.hits: cells [rows][columns][3] and levels [rows][columns].
void add_hits(const isowave::Frame &frame, nb::dict &result) {
  std::vector<Index3> cells;
  std::vector<std::uint32_t> levels;
  for (const isowave::Hit &hit : frame.hits) {
    cells.push_back(hit.cell);
    levels.push_back(hit.level);
  }
  result["cells"] = to_numpy<std::uint32_t>(std::move(cells), {frame.rows, frame.columns, 3});
  result["levels"] = to_numpy<std::uint32_t>(std::move(levels), {frame.rows, frame.columns});
}

/// is_of_rays: arrays are there even if they are empty.
nb::dict frame_dict(isowave::Frame &&frame, bool is_of_rays = false) {
  nb::dict result;
  const std::size_t rows = frame.rows, columns = frame.columns;
  if (!frame.picture.empty()) {
    result["picture"] =
        to_numpy<std::uint8_t>(std::move(frame.picture), {frame.size.height, frame.size.width, 3});
  }
  if (is_of_rays || !frame.depth.empty())
    result["depth"] = to_numpy<float>(std::move(frame.depth), {rows, columns});
  if (is_of_rays || !frame.normals.empty())
    result["normals"] = to_numpy<float>(std::move(frame.normals), {rows, columns, 3});
  if (is_of_rays || !frame.positions.empty())
    result["positions"] = to_numpy<double>(std::move(frame.positions), {rows, columns, 3});
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
    statistics["detail"] = detail;
  }
  result["statistics"] = statistics;
  return result;
}

/// [count][6]
using RayArray = nb::ndarray<double, nb::ro, nb::shape<-1, 6>, nb::c_contig>;

/// "smooth", "cell"; of a request's enums, Python sets this one alone.
isowave::Normals normals_of(const std::string &name) {
  if (name != "smooth" && name != "cell") throw Error("normals '" + name + "': smooth or cell");
  return name == "smooth" ? isowave::Normals::kSmooth : isowave::Normals::kCell;
}

isowave::FrameRequest request_of(const nb::dict &options) {
  isowave::FrameRequest request;
  const auto get = reader_of(options);
  isowave::for_each_field(request, [&](const char *name, auto &field) {
    using Field = std::decay_t<decltype(field)>;
    if constexpr (std::is_same_v<Field, isowave::Normals>) {
      std::string text = "smooth";
      get(name, text);
      field = normals_of(text);
    } else if constexpr (!std::is_enum_v<Field>) {
      get(name, field);
    }
  });
  return request;
}

isowave::RendererOptions renderer_options_of(const nb::dict &options) {
  isowave::RendererOptions result;
  const auto get = reader_of(options);
  get("width", result.largest.width);
  get("height", result.largest.height);
  get("samples", result.largest.samples);
  get("memory_budget", result.memory_budget);
  get("cache_blocks", result.cache_blocks);
  get("with_levels", result.with_levels);
  get("with_bounds", result.with_bounds);
  get("with_time_budget", result.with_time_budget);
  get("with_rays", result.with_rays);
  return result;
}

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
 public:
  using Owned = std::unique_ptr<isowave::Renderer, DestroyWithoutGil<isowave::Renderer>>;

  /// Draws on a device; with the option "quick", on the host until kernels are compiled.
  static std::unique_ptr<PyRenderer> on_device(const std::string &selector, const PyVolume &volume,
                                               const nb::dict &options) {
    const isowave::RendererOptions wanted = renderer_options_of(options);
    const auto get = reader_of(options);
    isowave::DeviceOptions device_options;
    get("profiling", device_options.profiling);
    bool quick = false;
    get("quick", quick);
    auto result = std::make_unique<PyRenderer>();
    {
      const WithoutGil no_gil;
      result->renderer_.reset(new isowave::Renderer(isowave::make_quick_renderer(
          isowave::open_device(selector, device_options), volume.volume, wanted)));
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
  /// interrupts  signals are looked for after each pass, which waits for that
  nb::dict render(const nb::dict &options, const std::optional<nb::callable> &on_pass,
                  bool interrupts) {
    isowave::FrameRequest request = request_of(options);
    if (!renderer_->ready_for(request)) wait();
    isowave::Frame frame = without_gil([&](Callbacks &callbacks) {
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

  nb::tuple camera(double isovalue, std::uint32_t width, std::uint32_t height) {
    return camera_tuple(without_gil([&](Callbacks &) {
      return renderer_->camera(isovalue, isowave::ImageSize{width, height, 1});
    }));
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
  /// Calls work(callbacks) without the GIL, and raises what a callback has raised.
  template <class Work>
  auto without_gil(const Work &work) {
    if (processes_) return processes_->without_gil(work);
    Callbacks callbacks;
    return callbacks.without_gil([&] { return work(callbacks); });
  }

  std::unique_ptr<PyProcesses>
      processes_;  ///< a team's; the renderer does not call it when it goes
  Owned renderer_;
};

/// [height][width][3, or 4 with alpha]
using Picture =
    nb::ndarray<std::uint8_t, nb::ro, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;

isowave::Frame frame_of(const Picture &picture) {
  isowave::Frame frame;
  frame.size = {static_cast<std::uint32_t>(picture.shape(1)),
                static_cast<std::uint32_t>(picture.shape(0)), 1};
  frame.picture.assign(picture.data(), picture.data() + picture.size());
  return frame;
}

nb::bytes encode_png(const Picture &picture) {
  const isowave::Frame frame = frame_of(picture);
  std::vector<std::uint8_t> bytes;
  {
    const WithoutGil no_gil;
    bytes = isowave::encode_png(frame);
  }
  return nb::bytes(bytes.data(), bytes.size());
}

void save_png(const Picture &picture, const std::filesystem::path &path) {
  const isowave::Frame frame = frame_of(picture);
  const WithoutGil no_gil;
  isowave::save_png(frame, path);
}

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

NB_MODULE(_core, m) {
  nb::exception<Error>(m, "Error", PyExc_RuntimeError);
  // Threads that are still at work when Python ends keep their objects: that is no leak to tell of.
  nb::set_leak_warnings(false);
  nb::module_::import_("atexit").attr("register")(
      nb::cpp_function([] { PythonsEnd::instance().come(); }));
  m.def("is_ending", [] { return PythonsEnd::instance().is_near(); });
  m.attr("__version__") = std::string(isowave::version());
  m.def("devices", &list_devices);
  m.def("encode_png", &encode_png, "picture"_a);
  m.def("save_png", &save_png, "picture"_a, "path"_a);

  nb::class_<PyVolume>(m, "Volume")
      .def_prop_ro("dims", [](const PyVolume &v) { return v.volume->grid().dims; })
      .def_prop_ro("spacing", [](const PyVolume &v) { return v.volume->grid().spacing; })
      .def_prop_ro("origin", [](const PyVolume &v) { return v.volume->grid().origin; })
      .def_prop_ro("direction", [](const PyVolume &v) { return v.volume->grid().direction; })
      .def_prop_ro("source_type",
                   [](const PyVolume &v) { return type_name(v.volume->source_type()); })
      .def_prop_ro("value_range", [](const PyVolume &v) { return v.volume->value_range(); })
      .def_prop_ro("float32_positions",
                   [](const PyVolume &v) { return v.volume->float32_positions(); })
      .def_prop_ro("notices", [](const PyVolume &v) { return v.volume->notices(); })
      .def(
          "isovalue_notice",
          [](const PyVolume &v, double isovalue) { return v.volume->isovalue_notice(isovalue); },
          "isovalue"_a)
      .def_prop_ro("compression",
                   [](const PyVolume &v) { return std::string(v.volume->compression()); })
      .def_prop_ro("bits_per_voxel", [](const PyVolume &v) { return v.volume->bits_per_voxel(); })
      .def_prop_ro("compressed_bytes",
                   [](const PyVolume &v) { return v.volume->compressed_bytes(); })
      .def_prop_ro("max_voxel_error", [](const PyVolume &v) { return v.volume->max_voxel_error(); })
      .def_prop_ro("errors_are_stated",
                   [](const PyVolume &v) { return v.volume->errors_are_stated(); })
      .def_prop_ro("num_levels", [](const PyVolume &v) { return v.volume->num_levels(); })
      .def(
          "level_dims",
          [](const PyVolume &v, std::uint32_t level) { return v.volume->level_grid(level).dims; },
          "level"_a)
      .def("decode", &decode, "level"_a, "begin"_a, "end"_a, "step"_a)
      .def("sample", &sample, "max_voxels"_a)
      .def(
          "save",
          [](const PyVolume &v, const std::filesystem::path &path) { v.volume->save(path); },
          "path"_a, nb::call_guard<WithoutGil>())
      .def("extract", &extract, "device"_a, "isovalue"_a, "level"_a, "normals"_a,
           "exact_vertices"_a, "memory_budget"_a, "progress"_a.none());
  m.def("save_mesh", &save_mesh, "vertices"_a, "faces"_a, "normals"_a.none(), "path"_a);
  m.def("compress", &compress, "read"_a, "type"_a, "dims"_a, "spacing"_a, "origin"_a, "direction"_a,
        "options"_a, "keep"_a, "path"_a.none(), "progress"_a.none());
  m.def("compress_array", &compress_array, "array"_a, "type"_a, "dims"_a, "spacing"_a, "origin"_a,
        "direction"_a, "options"_a, "progress"_a.none());
  m.def("open", &open_volume, "path"_a, "options"_a, "dims"_a.none(), "type"_a.none(),
        "spacing"_a.none(), "progress"_a.none());

  nb::class_<PassView>(m, "PassView")
      .def_prop_ro("passes", &PassView::passes)
      .def_prop_ro("completed_percent", &PassView::completed_percent)
      .def("picture", &PassView::picture);
  nb::class_<PyRenderer>(m, "Renderer")
      .def("render", &PyRenderer::render, "request"_a, "on_pass"_a.none(), "interrupts"_a)
      .def("cast_rays", &PyRenderer::cast_rays, "rays"_a, "isovalue"_a, "normals"_a)
      .def("camera", &PyRenderer::camera, "isovalue"_a, "width"_a, "height"_a)
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
      .def_prop_ro("direction", [](const PyRenderer &r) { return r.renderer().grid().direction; });
  m.def("device_renderer", &PyRenderer::on_device, "device"_a, "volume"_a, "options"_a);
  m.def("host_renderer", &PyRenderer::on_host, "volume"_a, "memory_limit"_a);
  m.def("team_renderer", &PyRenderer::of_team, "processes"_a, "path"_a, "compression"_a,
        "options"_a);
}
