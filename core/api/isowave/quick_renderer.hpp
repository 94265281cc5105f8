#pragma once
// Draws on the host until a device's kernels are compiled.

#include <memory>

#include "isowave/device.hpp"
#include "isowave/host_renderer.hpp"
#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// Makes a renderer that draws on the host until a device's renderer is ready(), and then on the
/// device. Returns at once: a thread of its own makes the device's renderer. Other renderers of the
/// device wait meanwhile. Keeps device and volume alive.
///
/// Until ready(), the host decodes the volume when a frame first needs it. If the device becomes
/// ready during a frame, the device begins the frame anew, and on_pass sees its passes from the
/// first on. If the host cannot draw a request, or the volume exceeds the host's memory limit,
/// render() waits for the device. The renderer's destructor waits only for the kernel that is being
/// compiled.
///
/// Throws  Error: no device, or no volume; not enough memory; options out of range. Other errors of
///         the device's renderer are thrown by each call that needs the device
Renderer make_quick_renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                             const RendererOptions &options = {},
                             const HostRendererOptions &host_options = {});

}  // namespace isowave
