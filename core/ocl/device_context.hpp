#pragma once
// What the ocl::Devices of a process have together if they are the same device: its OpenCL context
// and the programs that were built in it. A second renderer then builds no program again, and PoCL
// loads its library of built-in functions, which takes a second, once.

#include <CL/opencl.hpp>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace isowave::core::ocl {

/// Macro name -> value, passed as -D to a program build. No white space in either.
using Defines = std::map<std::string, std::string>;
/// Stem of a kernel file, and macros.
using ProgramKey = std::pair<std::string, Defines>;

/// Safe for several threads.
class DeviceContext {
 public:
  /// The context of a device. It lives as long as anybody has it.
  ///
  /// Throws  cl::Error
  static std::shared_ptr<DeviceContext> of(const cl::Device &device);
  /// From now on contexts live as long as the process. For tests, which open devices by the
  /// hundred.
  static void keep_all();

  explicit DeviceContext(const cl::Device &device) : context(device) {}

  /// The program with this key. The first caller builds it; others wait. Valid as long as *this.
  ///
  /// Throws  what `build` throws
  const cl::Program &program(const ProgramKey &key, const std::function<cl::Program()> &build);

  /// After a failure of the device: of() makes a new context for it.
  void abandon() noexcept;

  const cl::Context context;

 private:
  std::mutex mutex_;
  std::map<ProgramKey, cl::Program> programs_;
};

}  // namespace isowave::core::ocl
