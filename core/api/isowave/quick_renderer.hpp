#pragma once
// Draws at once what a device's renderer will draw when its kernels are compiled.

#include <cstdint>
#include <memory>
#include <optional>

#include "isowave/device.hpp"
#include "isowave/frame.hpp"
#include "isowave/host_renderer.hpp"
#include "isowave/renderer.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// A HostRenderer until a Renderer is ready, which is made in a thread of its own; from then on
/// that Renderer. The pictures have the same bits. May be used from several threads: frames are
/// drawn one after the other.
class QuickRenderer {
 public:
  /// Begins to make the device's renderer, and returns at once. Meanwhile others that ask the
  /// device for anything wait. Keeps device and volume alive.
  ///
  /// Throws  Error: no device, or no volume; the memory does not suffice; options out of range.
  ///         What else goes wrong is thrown by render()
  QuickRenderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
                const RendererOptions &options = {}, const HostRendererOptions &host_options = {});
  /// Waits for the kernel that is being compiled, not for those behind it.
  ~QuickRenderer();
  QuickRenderer(QuickRenderer &&) noexcept;
  QuickRenderer &operator=(QuickRenderer &&) noexcept;

  /// Draws a frame as Renderer::render() does. Before ready(), on the host: the first time, the
  /// volume is decoded there. A frame at work when the device's renderer becomes ready is begun
  /// anew by that, and on_pass then sees its passes from the first on. Where the host cannot draw a
  /// request (HostRenderer::can_draw()), or the volume exceeds its memory limit, waits for the
  /// device's renderer.
  ///
  /// Throws  Error: as Renderer::render() does; and, each time, what went wrong when the device's
  ///         renderer was made
  Frame render(const FrameRequest &request);

  /// As Renderer::cast_rays() does, by whichever renderer there is.
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals = Normals::kSmooth);

  /// The view that Renderer::camera() takes, from whichever renderer there is.
  ///
  /// Throws  Error: NaN; as render() does
  Camera camera(double isovalue, std::optional<ImageSize> size = {});

  /// Makes the device's renderer no longer: the kernel that is being compiled is the last. Returns
  /// at once; afterwards, unless it was ready, calls that need it throw Error.
  void give_up();
  /// Whether the device's renderer is made, or could not be.
  bool ready() const;
  /// Waits until ready().
  ///
  /// Throws  Error: what went wrong when the device's renderer was made
  void wait() const;
  /// Of device memory that it holds; 0 before ready().
  std::uint64_t memory_bytes() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isowave
