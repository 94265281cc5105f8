#include "isowave/host_renderer.hpp"

#include <utility>

#include "core/api/guarded.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/host/host_renderer.hpp"

namespace isowave {

Renderer make_host_renderer(std::shared_ptr<const Volume> volume,
                            const HostRendererOptions &options) {
  return core::guarded("making a renderer", [&] {
    if (!volume) throw core::Error("a renderer needs a volume");
    auto on_host = std::make_unique<core::HostRenderer>(
        volume->implementation().volume,
        core::HostRendererOptions{options.memory_limit, options.num_threads});
    return Renderer(std::make_unique<Renderer::Implementation>(
        std::make_shared<Turns>(), std::move(volume), std::move(on_host)));
  });
}

}  // namespace isowave
