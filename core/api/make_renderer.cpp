#include "isowave/make_renderer.hpp"

#include <utility>

#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/base/error.hpp"
#include "core/host/host_renderer.hpp"
#include "core/ocl/device.hpp"
#include "isowave/host_renderer.hpp"
#include "isowave/quick_renderer.hpp"

namespace isowave {

namespace {

using core::ocl::DrawsOn;

/// The option that the host has no meaning for; null: none was given.
const char *option_of_devices(const RendererOptions &options, const DeviceOptions &device_options) {
  if (options.cache_blocks != 0) return "cache_blocks";
  return device_options.profiling ? "profiling" : nullptr;
}

/// Whether the host draws, although the user may also have a device.
bool host_draws(DrawsOn chosen, const Volume &volume, const RendererOptions &options,
                const char *device_option) {
  if (chosen == DrawsOn::kDevice) return false;
  if (chosen == DrawsOn::kHost && device_option != nullptr)
    throw core::Error("{} is for devices alone: leave it out on the host", device_option);
  const bool fits = core::HostRenderer::fits(volume.implementation().volume, options.memory_budget);
  if (chosen == DrawsOn::kHost || (fits && device_option == nullptr)) return true;
  if (!core::ocl::list_devices().empty()) return false;
  if (device_option != nullptr)
    throw core::Error("{} needs an OpenCL device, and there is none: leave it out", device_option);
  return true;  // making the renderer says how much memory it needs
}

}  // namespace

bool draws_on_host(std::string_view selector) {
  return core::guarded("looking for devices",
                       [&] { return core::ocl::choose_drawing(selector) != DrawsOn::kDevice; });
}

Renderer make_renderer(std::shared_ptr<const Volume> volume, const RendererOptions &options,
                       std::string_view selector, const DeviceOptions &device_options) {
  return core::guarded("making a renderer", [&] {
    if (!volume) throw core::Error("a renderer needs a volume");
    if (host_draws(core::ocl::choose_drawing(selector), *volume, options,
                   option_of_devices(options, device_options))) {
      return make_host_renderer(std::move(volume), {.memory_limit = options.memory_budget,
                                                    .field = options.field,
                                                    .largest = options.largest});
    }
    return make_quick_renderer(open_device(selector, device_options), std::move(volume), options);
  });
}

}  // namespace isowave
