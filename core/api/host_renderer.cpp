#include "isowave/host_renderer.hpp"

#include <utility>

#include "core/api/guarded.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/host/host_renderer.hpp"

namespace isowave {

namespace {

struct HostHeld {
  std::shared_ptr<const Volume> volume;
  Turns turns;  ///< one frame at a time
};

}  // namespace

Renderer make_host_renderer(std::shared_ptr<const Volume> volume,
                            const HostRendererOptions &options) {
  return core::guarded("making a renderer", [&] {
    if (!volume) throw core::Error("a renderer needs a volume");
    const auto held = std::make_shared<HostHeld>();
    held->volume = volume;
    const core::CompressedVolume &compressed = volume->implementation().volume;
    auto result = std::make_unique<CoreImplementation>(
        held, compressed, held->turns,
        std::make_unique<core::HostRenderer>(
            compressed, core::HostRendererOptions{options.memory_limit, options.num_threads}));
    result->grid = volume->grid();
    result->notices = volume->notices();
    result->volume = std::move(volume);
    return Renderer(std::move(result));
  });
}

}  // namespace isowave
