#include "isowave/quick_renderer.hpp"

#include <utility>

#include "core/api/device_implementation.hpp"
#include "core/api/device_renderer.hpp"
#include "core/api/guarded.hpp"
#include "core/api/host_renderer.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/base/error.hpp"
#include "core/frame/soon_renderer.hpp"
#include "core/render/memory_plan.hpp"

namespace isowave {

namespace {

/// Makes a device's renderer, which goes in a turn of the device.
std::shared_ptr<core::Renderer> make_soon(Device &device, const Volume &volume,
                                          const RendererOptions &options,
                                          const std::stop_token &stop) {
  return core::guarded("making a renderer", [&] {
    std::unique_ptr<core::Renderer> renderer = make_on_device(device, volume, options, [&stop] {
      if (stop.stop_requested()) throw core::Error("the renderer is no longer wanted");
    });
    return std::shared_ptr<core::Renderer>(renderer.release(), [&device](core::Renderer *made) {
      const TurnOrMine turn(device.implementation().mutex);
      delete made;
    });
  });
}

}  // namespace

Renderer make_quick_renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                             const RendererOptions &options,
                             const HostRendererOptions &host_options) {
  return core::guarded("making a renderer", [&] {
    check_there(device, volume);
    Device::Implementation &on = device->implementation();
    const core::CompressedVolume &compressed = volume->implementation().volume;
    core::make_plan(
        on.device, compressed,
        core::checked(core_options(options, volume->num_levels()), compressed, on.device));
    core::Abilities meanwhile = abilities_on_host(
        compressed, options.field ? &options.field->implementation().volume : nullptr);
    // The host would choose among levels that the device cannot draw.
    meanwhile.image_error = options.with_levels || volume->num_levels() == 1;
    const auto turns = std::make_shared<Turns>();  // one frame at a time
    auto renderer = std::make_unique<core::SoonRenderer>(core::SoonParts{
        .abilities = abilities_on_device(options, *volume),
        .make = [&to = *device, &of = *volume,
                 options](const std::stop_token &stop) { return make_soon(to, of, options, stop); },
        .before_use = [&on, &turn = *turns] { turn.take(on.mutex); },
        .meanwhile_abilities = meanwhile,
        .make_meanwhile =
            [&compressed, host_options, field = options.field] {
              HostRendererOptions with_field = host_options;
              with_field.field = field;
              return make_on_host(compressed, with_field);
            },
    });
    core::SoonRenderer *const soon = renderer.get();
    auto result =
        make_implementation(turns, std::move(device), std::move(volume), std::move(renderer));
    result->soon = soon;
    result->field = options.field;
    return Renderer(std::move(result));
  });
}

}  // namespace isowave
