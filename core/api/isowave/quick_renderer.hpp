#pragma once
// Draws at once what a device's renderer will draw when its kernels are compiled.

#include <memory>

#include "isowave/device.hpp"
#include "isowave/host_renderer.hpp"
#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// A renderer that draws on the host until a device's renderer is ready(), which is made in a
/// thread of its own; from then on on the device. Returns at once. Meanwhile others that ask the
/// device for anything wait. Keeps device and volume alive.
///
/// Until ready(), the volume is decoded on the host when a frame first needs it. A frame at work
/// when the device becomes ready is begun anew there, and on_pass then sees its passes from the
/// first on. If the host cannot draw a request, or the volume exceeds the host's memory limit,
/// render() waits for the device. The renderer's destructor waits for the kernel that is being
/// compiled, not for those behind it.
///
/// Throws  Error: no device, or no volume; the memory does not suffice; options out of range. What
///         else goes wrong is thrown by the calls that need the device, each time
Renderer make_quick_renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                             const RendererOptions &options = {},
                             const HostRendererOptions &host_options = {});

}  // namespace isowave
