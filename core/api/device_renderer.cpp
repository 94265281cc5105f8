#include "core/api/device_renderer.hpp"

#include <mutex>
#include <utility>

#include "core/api/device_implementation.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
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
  result.with_bounce = options.with_bounce;
  result.max_surfaces = options.with_surfaces;
  result.with_labels = options.with_labels;
  if (options.field) result.field = &options.field->implementation().volume;
  return result;
}

Choices choices_of(const RendererOptions &options) {
  return {.with_time_budget = options.with_time_budget};
}

core::Abilities abilities_on_device(const RendererOptions &options, const Volume &volume) {
  core::Abilities abilities =
      core::DeviceRenderer::abilities_of(core_options(options, volume.num_levels()));
  abilities.surface_error = options.with_bounds;
  abilities.sampled_error = abilities.image_error = true;
  abilities.time_budget = options.with_time_budget;
  return abilities;
}

std::unique_ptr<core::Renderer> make_on_device(Device &device, const Volume &volume,
                                               const RendererOptions &options,
                                               const std::function<void()> &before_kernel) {
  Device::Implementation &on = device.implementation();
  const core::CompressedVolume &compressed = volume.implementation().volume;
  const std::lock_guard lock(on.mutex);
  const KernelWatch watch(on.device, before_kernel);
  return add_choices(std::make_unique<core::DeviceRenderer>(
                         on.device, compressed, core_options(options, volume.num_levels())),
                     choices_of(options), compressed, compressed.rate());
}

void check_there(const std::shared_ptr<Device> &device,
                 const std::shared_ptr<const Volume> &volume) {
  if (!device || !volume) throw core::Error("a renderer needs a device and a volume");
}

std::unique_ptr<Renderer::Implementation> make_implementation(
    std::shared_ptr<Turns> turns, std::shared_ptr<Device> device,
    std::shared_ptr<const Volume> volume, std::unique_ptr<core::Renderer> renderer) {
  auto result = std::make_unique<Renderer::Implementation>(std::move(turns), std::move(volume),
                                                           std::move(renderer));
  result->device_info = device->info();
  result->device = std::move(device);
  return result;
}

Renderer::Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                   const RendererOptions &options)
    : implementation_(core::guarded("making a renderer", [&] {
        check_there(device, volume);
        auto renderer = make_on_device(*device, *volume, options);
        auto result =
            make_implementation(std::shared_ptr<Turns>(device, &device->implementation().mutex),
                                device, volume, std::move(renderer));
        result->field = options.field;
        return result;
      })) {}

}  // namespace isowave
