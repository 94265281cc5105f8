#pragma once
// Code that the parts of the module isowave._core share: the GIL, and how Python ends.
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
#include <nanobind/stl/unique_ptr.h>
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

namespace isowave_python {

using isowave::Error;
using isowave::Vector3;
using Index3 = std::array<std::uint32_t, 3>;
using Color = std::array<float, 3>;

/// A numpy array that owns the values, std::vector or isowave::Array. These may be arrays of
/// numbers: then `shape` has their length, too.
template <class Number, class Values>
nb::object to_numpy(Values &&values, std::initializer_list<std::size_t> shape) {
  static_assert(std::is_rvalue_reference_v<decltype(values)>);
  auto owned = std::make_unique<Values>(std::move(values));
  auto *data = reinterpret_cast<Number *>(owned->data());
  const nb::capsule owner(owned.release(),
                          [](void *held) noexcept { delete static_cast<Values *>(held); });
  return nb::cast(nb::ndarray<nb::numpy, Number>(data, shape, owner));
}

/// get(name, field): reads an option that is there and not None into the field.
inline auto reader_of(const nb::dict &options) {
  return [&options](const char *name, auto &field) {
    if (options.contains(name) && !options[name].is_none())
      field = nb::cast<std::decay_t<decltype(field)>>(options[name]);
  };
}

/// Arguments of isowave.Camera.
inline nb::tuple camera_tuple(const isowave::Camera &camera) {
  const auto vector = [](const Vector3 &v) { return nb::make_tuple(v[0], v[1], v[2]); };
  return nb::make_tuple(vector(camera.eye), vector(camera.at), vector(camera.up),
                        camera.fovy_degrees, camera.parallel_height);
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
  /// Calls work() with the GIL held. Returns false if that, or an earlier callback, has raised
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

/// The exception that ends the library's work after a callback has raised something.
struct Stopped {};

/// Destroys T without the GIL.
template <class T>
struct DestroyWithoutGil {
  void operator()(T *object) const {
    const WithoutGil no_gil;
    delete object;
  }
};

/// A volume, as Python holds it.
struct PyVolume {
  std::shared_ptr<const isowave::Volume> volume;
};

isowave::Compression compression_of(const nb::dict &options);
void add_volumes(nb::module_ &m);
void add_renderers(nb::module_ &m);
void add_annotations(nb::module_ &m);
void add_pages(nb::module_ &m);

}  // namespace isowave_python
