#pragma once
// The host's own memory, made known to a device, which then copies into it without a detour.

#include <cstddef>
#include <functional>
#include <memory>
#include <span>

#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

/// Pins memory for a device's copies, until the result goes; see HostMemory::Pin. Commands must be
/// done by then. Copies to other memory take five times as long (H100). CPUs need nothing, and
/// devices that cannot pin do without: the result is null.
///
/// memory   begins with a page
/// device   must outlive the result
std::function<std::shared_ptr<void>(std::span<std::byte>)> pin_for(Device &device);

}  // namespace isowave::core::ocl
