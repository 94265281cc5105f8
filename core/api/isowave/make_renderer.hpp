#pragma once
// Draws on a GPU if there is one, else on the host.

#include <memory>
#include <string_view>

#include "isowave/device.hpp"
#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// Whether make_renderer() draws on the host.
///
/// selector  "host", or as for open_device(). "": the environment variable ISOWAVE_DEVICE, else the
///           host if there is no GPU and no accelerator
bool draws_on_host(std::string_view selector = {});

/// Makes a renderer that draws on a device, as make_quick_renderer(), or on the host, as
/// make_host_renderer(). Both draw the same bits. Keeps the volume alive.
///
/// Some requests can only be met by a device: options.cache_blocks, device_options.profiling, and
/// volumes for which the host has not enough memory. If selector is "", an OpenCL device for the
/// CPU then draws, if there is one.
///
/// options         on the host: memory_budget is its memory limit, frames may be larger than
///                 largest, and requests may ask for all else
/// selector        as for draws_on_host()
/// device_options  of a device
/// Throws          Error: as make_quick_renderer(), make_host_renderer() and open_device()
Renderer make_renderer(std::shared_ptr<const Volume> volume, const RendererOptions &options = {},
                       std::string_view selector = {}, const DeviceOptions &device_options = {});

}  // namespace isowave
