#pragma once
// A device, its in-order queues (one for work, one for transfers beside it), its programs, its
// memory ledger and its stage timings.
//
// Everything that talks to OpenCL goes through this folder. Objects are RAII; a Device must outlive
// its buffers and kernels. Not thread-safe: one thread drives one Device.

#include <CL/opencl.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/ocl/device_context.hpp"
#include "core/ocl/memory_ledger.hpp"
#include "core/ocl/stage_timer.hpp"

namespace isowave::core::ocl {

enum class DeviceType { kCpu, kGpu, kAccelerator, kOther };
std::string_view to_string(DeviceType type);

/// The abilities of a device, probed when it is opened or listed. Optional features have tested
/// fallbacks.
struct Capabilities {
  bool int64_atomics = false;             ///< cl_khr_int64_base_atomics and extended
  bool fp64 = false;                      ///< doubles in kernels
  bool sub_groups = false;                ///< cl_khr_subgroups or OpenCL 2.1+ with sub-groups > 0
  bool correctly_rounded_divide = false;  ///< accepts -cl-fp32-correctly-rounded-divide-sqrt
  bool denormals = false;                 ///< float32 denormals kept
  bool rounds_to_nearest = false;         ///< float32 results, as OpenCL's full profile does
  bool nan = false;                       ///< float32 NaN, as OpenCL's full profile has it
  std::uint64_t global_memory = 0;        ///< bytes
  std::uint64_t largest_allocation = 0;   ///< bytes in one buffer
  std::uint64_t local_memory = 0;         ///< bytes per work-group
  std::uint32_t max_work_group_size = 0;  ///< of any kernel; a kernel's own may be lower
  std::uint32_t compute_units = 0;
  /// Rays, or the like, that a launch may have so that no watchdog of a desktop ends it.
  std::uint64_t elements_per_launch = UINT64_MAX;
  std::uint32_t native_float_width = 0;  ///< floats in a vector of its processors
};

struct DeviceInfo {
  std::uint32_t index = 0;  ///< position in list_devices(), what `--device 2` means
  std::string name, vendor, platform, device_version, driver_version;
  DeviceType type = DeviceType::kOther;
  Capabilities capabilities;
};

/// Every OpenCL 1.2 device of every platform, in the loader's order. Empty when there is none.
std::vector<DeviceInfo> list_devices();

/// Picks a device. `selector`: "" (the ISOWAVE_DEVICE environment variable if set, else the first
/// GPU, else the first accelerator, else the first CPU, else the first device), an index, a type
/// ("gpu", "cpu", "accelerator") or a case-insensitive fragment of the device or platform name.
///
/// Throws  Error naming the devices there are; "host", which is no device
DeviceInfo choose_device(std::string_view selector = "");
/// The rule of choose_device() alone. `environment` stands for ISOWAVE_DEVICE and counts when
/// `selector` is empty. The first of several matches is taken. Returns a reference into `devices`.
const DeviceInfo &pick_device(std::span<const DeviceInfo> devices, std::string_view selector,
                              std::string_view environment);

/// What draws if the user may choose between the host and devices.
enum class DrawsOn {
  kDevice,         ///< the device of choose_device()
  kHost,           ///< the host, since the selector or ISOWAVE_DEVICE is "host"
  kHostByDefault,  ///< the host, since neither names a device, and no GPU or accelerator is there
};
/// Loads no driver if the selector or ISOWAVE_DEVICE says enough.
///
/// selector  "host", or as for choose_device()
DrawsOn choose_drawing(std::string_view selector = "");
/// The rule of choose_drawing() alone.
///
/// list         gives the devices, if the rule needs them
/// environment  stands for ISOWAVE_DEVICE
DrawsOn pick_drawing(const std::function<std::vector<DeviceInfo>()> &list,
                     std::string_view selector, std::string_view environment);

class Device {
 public:
  /// profiling  record events so that StageTimer reports; costs about 10 us a launch on GPUs
  /// Throws     Error: the device lacks what core needs: OpenCL 1.2, a compiler, 32 KiB of local
  ///            memory, 64-bit integers, arithmetic that rounds to nearest
  explicit Device(const DeviceInfo &info, bool profiling = false);
  Device(const Device &) = delete;
  Device &operator=(const Device &) = delete;

  const DeviceInfo &info() const { return info_; }
  const Capabilities &capabilities() const { return info_.capabilities; }
  /// One line on what the device computes otherwise than the host, so that pictures may differ in
  /// last bits; empty: nothing. From a self-test at opening (core/ocl/arithmetic.hpp).
  const std::string &notice() const { return notice_; }
  const cl::Context &context() const { return context_->context; }
  cl::CommandQueue &queue() { return queue_; }
  /// A second in-order queue, made when it is first asked for: for transfers that overlap with the
  /// work of queue(). Events order the two.
  ///
  /// Throws  Error
  cl::CommandQueue &transfer_queue();
  MemoryLedger &ledger() { return ledger_; }
  StageTimer &timer() { return timer_; }

  /// The program of one kernel file stem ("radix_sort" -> kernels_cl/paper/radix_sort.cl), built
  /// once per (stem, defines) by all that have the device open.
  ///
  /// Throws  BuildError: it does not build
  const cl::Program &program(std::string_view stem, const Defines &defines = {});

  /// A program of its own, which the device does not keep.
  ///
  /// Throws  as program()
  cl::Program build(std::string_view stem, const Defines &defines);

  /// From now on programs are built that know of bricks (ISO_BRICKS), which take 1 to 2 % longer.
  /// They draw whole volumes, too.
  void draw_bricks() { draws_bricks_ = true; }
  /// From now on programs are built that know of voxels without data (ISO_NO_DATA), which take a
  /// little longer. They draw other volumes, too.
  ///
  /// Throws  Error: the device has no NaN
  void draw_no_data();

  /// The programs asked for so far, sorted: "march -D ISO_GROUP_SIZE=64 -D ISO_LEVELS=0".
  std::vector<std::string> built_programs() const;

  /// While one lives, all that happens counts as compiling. For launches that do nothing but make
  /// the driver compile: many compile a kernel when it is first launched. Each launch is waited
  /// for.
  class Compiling {
   public:
    ~Compiling();
    Compiling(const Compiling &) = delete;
    Compiling &operator=(const Compiling &) = delete;

   private:
    friend class Device;
    explicit Compiling(Device &device);
    Device &device_;
    std::chrono::steady_clock::time_point begin_;
  };
  [[nodiscard]] Compiling compiling() { return Compiling(*this); }
  bool is_compiling() const { return compiling_depth_ > 0; }
  /// Wall clock spent on compiling so far: programs that were built, and while a Compiling lived.
  double compile_ms() const { return compile_ms_; }

  /// Will be told the name of each kernel before it is made for the first time.
  void on_new_kernel(std::function<void(std::string_view)> callback) {
    on_new_kernel_ = std::move(callback);
  }
  void announce_kernel(std::string_view name) {
    if (on_new_kernel_) on_new_kernel_(name);
  }

  /// Work-groups that keep the device busy: what a grid-stride kernel should launch at most.
  std::uint32_t max_resident_groups() const;

  /// Waits for everything enqueued, on both queues.
  ///
  /// Throws  Error: the device failed
  void finish();
  /// Waits as finish(). False: the device failed, and commands may still be at work.
  bool settle() noexcept;

 private:
  /// With the macros that the program's text names, and no others.
  ProgramKey key_of(std::string_view stem, const Defines &defines) const;

  DeviceInfo info_;
  cl::Device device_;
  std::shared_ptr<DeviceContext> context_;
  cl::CommandQueue queue_, transfer_queue_;
  MemoryLedger ledger_;
  StageTimer timer_;
  std::map<ProgramKey, const cl::Program *> programs_;
  std::function<void(std::string_view)> on_new_kernel_;
  std::string notice_;
  double compile_ms_ = 0;
  bool draws_bricks_ = false, draws_no_data_ = false;
  int compiling_depth_ = 0;
};

/// "CL_OUT_OF_RESOURCES (-5)".
std::string error_name(cl_int code);

}  // namespace isowave::core::ocl
