#pragma once
// Private to core/api: renderers that draw on a device.

#include <functional>
#include <memory>

#include "core/api/choices.hpp"
#include "core/api/renderer_implementation.hpp"
#include "core/render/renderer_options.hpp"

namespace isowave {

core::RendererOptions core_options(const RendererOptions &options, std::uint32_t num_levels);
Choices choices_of(const RendererOptions &options);
/// Abilities of the renderer that make_on_device() makes.
core::Abilities abilities_on_device(const RendererOptions &options, const Volume &volume);
/// Makes a renderer, in a turn of the device. before_kernel: called before each kernel is compiled;
/// an exception from it is thrown here.
std::unique_ptr<core::Renderer> make_on_device(Device &device, const Volume &volume,
                                               const RendererOptions &options,
                                               const std::function<void()> &before_kernel = {});
/// Throws  core::Error: there is no device, or no volume
void check_there(const std::shared_ptr<Device> &device,
                 const std::shared_ptr<const Volume> &volume);
/// Makes the part of isowave::Renderer behind that renderer.
std::unique_ptr<Renderer::Implementation> make_implementation(
    std::shared_ptr<Turns> turns, std::shared_ptr<Device> device,
    std::shared_ptr<const Volume> volume, std::unique_ptr<core::Renderer> renderer);

}  // namespace isowave
