#include "core/api/device_renderer.hpp"

#include <mutex>
#include <utility>

#include "core/accuracy/bounded_renderer.hpp"
#include "core/api/device_implementation.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/frame/timed_renderer.hpp"
#include "core/render/device_renderer.hpp"

namespace isowave {

core::RendererOptions core_options(const RendererOptions &options, std::uint32_t num_levels) {
  core::RendererOptions result;
  result.size = core_size(options.largest);
  result.memory_budget = options.memory_budget;
  result.cache_slots = options.cache_blocks;
  result.with_levels = options.with_levels && num_levels > 1;
  result.with_bounds = options.with_bounds;
  result.with_kept_picture = options.with_time_budget;
  result.with_given_rays = options.with_rays;
  return result;
}

std::unique_ptr<core::Renderer> add_choices(std::unique_ptr<core::Renderer> renderer,
                                            const RendererOptions &options,
                                            const core::CompressedVolume &volume, double rate) {
  if (options.with_bounds)
    renderer = std::make_unique<core::BoundedRenderer>(std::move(renderer), volume, rate);
  if (options.with_time_budget)
    renderer = std::make_unique<core::TimedRenderer>(std::move(renderer));
  return renderer;
}

std::unique_ptr<Renderer::Implementation> make_device_implementation(
    std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
    const RendererOptions &options, const std::function<void()> &before_kernel) {
  if (!device || !volume) throw core::Error("a renderer needs a device and a volume");
  Device::Implementation &on = device->implementation();
  const core::CompressedVolume &compressed = volume->implementation().volume;
  const std::lock_guard lock(on.mutex);
  const KernelWatch watch(on.device, before_kernel);
  std::unique_ptr<core::Renderer> renderer =
      add_choices(std::make_unique<core::DeviceRenderer>(
                      on.device, compressed, core_options(options, volume->num_levels())),
                  options, compressed, compressed.rate());
  auto result = std::make_unique<CoreImplementation>(
      std::make_shared<std::pair<std::shared_ptr<Device>, std::shared_ptr<const Volume>>>(device,
                                                                                          volume),
      compressed, on.mutex, std::move(renderer));
  result->device_info = on.info;
  result->grid = volume->grid();
  result->notices = volume->notices();
  result->device = std::move(device);
  result->volume = std::move(volume);
  return result;
}

Renderer::Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                   const RendererOptions &options)
    : implementation_(core::guarded("making a renderer", [&] {
        return make_device_implementation(std::move(device), std::move(volume), options);
      })) {}
}  // namespace isowave
