#pragma once
// Private to core/api: what is behind isowave::Device.

#include <functional>
#include <string_view>

#include "core/api/turns.hpp"
#include "core/ocl/device.hpp"
#include "isowave/device.hpp"

namespace isowave {

struct Device::Implementation {
  Implementation(const core::ocl::DeviceInfo &device_info, const DeviceOptions &options);

  DeviceInfo info;
  mutable Turns mutex;  ///< one thread at a time drives the device
  core::ocl::Device device;
};

/// Has before_kernel called for each kernel that is compiled while this lives.
class KernelWatch {
 public:
  KernelWatch(core::ocl::Device &device, const std::function<void()> &before_kernel)
      : device_(device) {
    if (before_kernel)
      device.on_new_kernel([&before_kernel](std::string_view) { before_kernel(); });
  }
  ~KernelWatch() { device_.on_new_kernel({}); }
  KernelWatch(const KernelWatch &) = delete;
  KernelWatch &operator=(const KernelWatch &) = delete;

 private:
  core::ocl::Device &device_;
};

}  // namespace isowave
