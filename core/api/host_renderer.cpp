#include "isowave/host_renderer.hpp"

#include <utility>

#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/api/host_renderer.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/host/host_renderer.hpp"

namespace isowave {

std::unique_ptr<core::Renderer> make_on_host(const core::CompressedVolume &volume,
                                             const HostRendererOptions &options) {
  const core::HostRendererOptions core_options{
      .memory_limit = options.memory_limit,
      .num_threads = options.num_threads,
      .field = options.field ? &options.field->implementation().volume : nullptr,
      .largest = core_size(options.largest)};
  return add_choices(std::make_unique<core::HostRenderer>(volume, core_options),
                     {.with_time_budget = true}, volume, volume.rate());
}

core::Abilities abilities_on_host(const core::CompressedVolume &volume,
                                  const core::CompressedVolume *field) {
  core::Abilities abilities = core::HostRenderer::abilities_of(volume);
  abilities.field = field != nullptr;
  abilities.field_labels = field != nullptr && core::are_labels(*field);
  abilities.surface_error = abilities.sampled_error = abilities.image_error = true;
  abilities.time_budget = true;
  return abilities;
}

Renderer make_host_renderer(std::shared_ptr<const Volume> volume,
                            const HostRendererOptions &options) {
  return core::guarded("making a renderer", [&] {
    if (!volume) throw core::Error("a renderer needs a volume");
    auto on_host = make_on_host(volume->implementation().volume, options);
    auto result = std::make_unique<Renderer::Implementation>(std::make_shared<Turns>(),
                                                             std::move(volume), std::move(on_host));
    result->field = options.field;
    return Renderer(std::move(result));
  });
}

}  // namespace isowave
