#pragma once
// Draws frames of one volume on one device.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "isowave/device.hpp"
#include "isowave/frame.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// What a renderer is made for. Its memory is taken when it is made; without a budget and
/// cache_blocks, the cache grows between frames, should these need more blocks.
struct RendererOptions {
  ImageSize largest{};              ///< picture: frames may have as many rays, in any shape
  std::uint64_t memory_budget = 0;  ///< of device memory [bytes]; 0: three quarters of it
  /// Decoded blocks of 4^3 voxels that are kept, 8 and more; 0: as many as the budget allows, or,
  /// without one, as frames need.
  std::uint32_t cache_blocks = 0;
  bool with_levels = false;       ///< frames may use levels of detail
  bool with_bounds = false;       ///< frames may ask for bounds and max_surface_error
  bool with_time_budget = false;  ///< frames may have a time budget
  bool with_rays = false;         ///< frames may have ambient rays, and cast_rays() may be called
};

/// May be used from several threads: frames are drawn one after the other.
class Renderer {
 public:
  /// Brings the compressed volume to the device, or what of it is needed where it does not fit, and
  /// has the kernels compiled. Keeps device and volume alive.
  ///
  /// Throws  Error: the memory does not suffice (names what would), options out of range
  Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
           const RendererOptions &options = {});
  ~Renderer();
  Renderer(Renderer &&) noexcept;
  Renderer &operator=(Renderer &&) noexcept;

  /// Draws a frame and waits for it. Decoded blocks are kept for further frames.
  ///
  /// Throws  Error: a request that the renderer was not made for, a degenerate camera, a NaN;
  ///         further frames are drawn as if it had not been
  Frame render(const FrameRequest &request);

  /// The first hit of each ray, in the finest level of detail: from a frame of one row, with depth
  /// (in lengths of the ray's direction), normals, positions and hits. Needs with_rays.
  ///
  /// Throws  Error: the isovalue is NaN; a ray is not finite, has no direction, or begins more than
  ///         1e7 voxels away from the volume's origin; a hit is so many lengths of the direction
  ///         away that float32 does not hold the depth
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals = Normals::kSmooth);

  /// A view from the front right and above in which the isosurface fills a picture of that size
  /// (none: of the largest); the volume, where there is no surface.
  Camera camera(double isovalue, std::optional<ImageSize> size = {});

  const std::shared_ptr<Device> &device() const;
  const std::shared_ptr<const Volume> &volume() const;
  std::uint64_t memory_bytes() const;  ///< of device memory that it holds
  double setup_ms() const;             ///< wall clock of uploads, without compiling

 private:
  friend class QuickRenderer;
  /// before_kernel: called before each kernel is compiled; what it throws is thrown here.
  Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
           const RendererOptions &options, const std::function<void()> &before_kernel);
  /// Throws  Error: the memory does not suffice, or options are out of range
  static void check_options(const Device &device, const Volume &volume,
                            const RendererOptions &options);
  void release() noexcept;

  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isowave
