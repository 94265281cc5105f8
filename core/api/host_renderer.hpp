#pragma once
// Private to core/api: renderers that draw on the host.

#include <memory>

#include "core/api/choices.hpp"
#include "isowave/host_renderer.hpp"

namespace isowave {

/// volume  must outlive the result
/// Throws  core::Error: as make_host_renderer()
std::unique_ptr<core::Renderer> make_on_host(const core::CompressedVolume &volume,
                                             const HostRendererOptions &options);
/// Abilities of the renderer that make_on_host() makes.
core::Abilities abilities_on_host(const core::CompressedVolume &volume,
                                  const core::CompressedVolume *field);

}  // namespace isowave
