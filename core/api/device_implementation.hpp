#pragma once
// Private to core/api: what is behind isowave::Device.

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

}  // namespace isowave
