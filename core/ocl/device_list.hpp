#pragma once
// Private to core/ocl: the OpenCL handles behind the DeviceInfo of list_devices().

#include <CL/opencl.hpp>
#include <string_view>

#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

/// The handle of a listed device.
///
/// Throws  Error: the list has changed since, so that it is gone
cl::Device device_handle(const DeviceInfo &info);

/// True when `list`, words between spaces, holds `word`: an extension in CL_DEVICE_EXTENSIONS.
bool has_word(std::string_view list, std::string_view word);

}  // namespace isowave::core::ocl
