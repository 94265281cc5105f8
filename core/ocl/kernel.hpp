#pragma once
// A kernel whose arguments are checked by the C++ compiler:
//
//   #include "kernels/launch_probe.hpp"  // made from kernels_cl/probes/launch_probe.cl
//   Kernel<kernels::scale_values> scale_{device};
//   scale_(Range::strided(count, 64, device), input, count, factor, output);
//
// Its program is built when it is first launched, so that what is not used is not built. Code that
// times launches does one before that has nothing to do.

#include <CL/opencl.hpp>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "core/ocl/buffer.hpp"
#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

/// `global const T *` or `constant T *` of a kernel.
template <class T>
struct In {
  In(const Buffer<T> &buffer)
      : mem(buffer.mem()) {}  // NOLINT(google-explicit-constructor): tags convert
  const cl::Buffer &mem;
};
/// `global T *`, which the kernel may also read.
template <class T>
struct Out {
  Out(Buffer<T> &buffer) : mem(buffer.mem()) {}  // NOLINT(google-explicit-constructor)
  const cl::Buffer &mem;
};
/// `local T *` of `count` elements.
template <class T>
struct Local {
  std::size_t count;
};

/// Work-items of a work-group that stages ask for unless they are told otherwise.
inline constexpr std::uint32_t kGroupSize = 64;

/// The one-dimensional shape of a launch: num_groups work-groups of group_size work-items. A kernel
/// whose own limit on this device is lower is launched with more and smaller groups.
struct Range {
  std::size_t num_groups = 0;
  std::size_t group_size = 1;
  /// Each group has work of its own, which is not shared out among more of them.
  bool keeps_groups = false;
  /// Launches that share the work, one after the other: the kernel's work-items go on by `parts`
  /// times get_global_size(0), from get_global_id(0) on.
  std::uint32_t parts = 1;

  /// As many groups as there are, whatever their size: one, for kernels that scan a table.
  static Range groups(std::size_t num_groups, std::size_t group_size) {
    return {num_groups, group_size, true};
  }
  /// One work-item per element, rounded up to whole groups.
  static Range covering(std::size_t count, std::size_t group_size) {
    return {(count + group_size - 1) / group_size, group_size};
  }
  /// In as many parts as it takes that no launch has more elements than the device gets through
  /// before a watchdog takes it for hung.
  Range in_parts(std::uint64_t count, const Device &device) const;
  /// For grid-stride kernels: as covering(), but never more groups than keep the device busy.
  /// oversubscribe: this many times as many, for kernels so lean that a device holds more groups
  /// than of others.
  static Range strided(std::size_t max_count, std::size_t group_size, const Device &device,
                       std::size_t oversubscribe = 1);
  /// For grid-stride kernels that do about the same for each element, and read what lies beside it
  /// in memory: as covering() on CPUs, whose drivers run the work-items of a group one after the
  /// other, and so read memory in its order; as strided() on GPUs.
  static Range each(std::size_t count, std::size_t group_size, const Device &device);
};

class RawKernel {
 public:
  RawKernel(Device &device, std::string_view stem, const char *kernel_name, const Defines &defines)
      : device_(&device), stem_(stem), name_(kernel_name), defines_(defines) {}

 protected:
  /// Makes the kernel, unless that has been done; its program, too. If the device gives the kernel
  /// no groups of ISO_GROUP_SIZE work-items, the kernel is built for smaller ones.
  ///
  /// Throws  Error: there is none of that name
  void make();
  /// Enqueues; waits at the first launch, and while a Device::Compiling lives.
  ///
  /// Throws  Error naming kernel and OpenCL error
  void launch(const Range &range);
  template <class T>
  void set(cl_uint index, const In<T> &arg) {
    set_mem(index, arg.mem);
  }
  template <class T>
  void set(cl_uint index, const Out<T> &arg) {
    set_mem(index, arg.mem);
  }
  template <class T>
  void set(cl_uint index, const Local<T> &arg) {
    set_bytes(index, arg.count * sizeof(T), nullptr);
  }
  template <class T>
  requires std::is_trivially_copyable_v<T>
  void set(cl_uint index, const T &value) { set_bytes(index, sizeof(T), &value); }

 private:
  void set_mem(cl_uint index, const cl::Buffer &mem);
  void set_bytes(cl_uint index, std::size_t bytes, const void *data);
  /// The kernel, built with these macros. Asks the device how large its groups may be.
  cl::Kernel build(const Defines &defines);

  Device *device_;
  std::string stem_, name_;
  Defines defines_;
  cl::Kernel kernel_;
  std::size_t max_group_size_ = 0;  ///< a power of two: what the device gives this kernel
  bool is_new_ = false;             ///< never launched
};

/// A kernel's parameters in order: In<T>, Out<T>, Local<T> or values.
template <class... Types>
struct Params {};

template <class Signature, class = typename Signature::Params>
class Kernel;

/// Signature: one of namespace kernels (tools/cmake/kernel_signatures.cmake).
template <class Signature, class... Types>
class Kernel<Signature, Params<Types...>> : public RawKernel {
 public:
  explicit Kernel(Device &device, const Defines &defines = {})
      : RawKernel(device, Signature::kStem, Signature::kName, defines) {}

  /// Enqueues one launch in queue order; does not wait but at the first one, which counts as
  /// compiling. A range of 0 groups does nothing.
  void operator()(const Range &range, const Types &...args) {
    if (range.num_groups == 0) return;
    make();
    [[maybe_unused]] cl_uint index = 0;  // a kernel may have no parameters
    (this->set(index++, args), ...);
    launch(range);
  }
};

}  // namespace isowave::core::ocl
