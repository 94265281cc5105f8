#pragma once
// Private to core/api: renderers that draw on a device.

#include <functional>
#include <memory>

#include "core/api/renderer_implementation.hpp"
#include "core/render/renderer_options.hpp"

namespace isowave {

core::RendererOptions core_options(const RendererOptions &options, std::uint32_t num_levels);
/// Around a renderer of a device, what the options ask for.
std::unique_ptr<core::Renderer> add_choices(std::unique_ptr<core::Renderer> renderer,
                                            const RendererOptions &options,
                                            const core::CompressedVolume &volume, double rate);
/// A renderer of a device. before_kernel: called before each kernel is compiled; what it throws is
/// thrown here.
std::unique_ptr<Renderer::Implementation> make_device_implementation(
    std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
    const RendererOptions &options, const std::function<void()> &before_kernel = {});

}  // namespace isowave
