#pragma once
// Draws frames of one volume.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "isowave/frame.hpp"
#include "isowave/volume.hpp"

namespace isowave {

class Device;
struct DeviceInfo;

/// Options of a renderer. A renderer takes its memory when it is made. Without memory_budget
/// and cache_blocks, the cache grows between frames if frames need more blocks.
struct RendererOptions {
  ImageSize largest{};              ///< largest picture: frames may have as many rays, in any shape
  std::uint64_t memory_budget = 0;  ///< bound on device memory [bytes]; 0: three quarters of it
  /// Number of decoded blocks of 4^3 voxels that are kept, 8 and more. 0: as many as memory_budget
  /// allows, or without a budget as many as frames need.
  std::uint32_t cache_blocks = 0;
  bool with_levels = false;       ///< frames may use levels of detail
  bool with_bounds = false;       ///< frames may ask for bounds and max_surface_error
  bool with_time_budget = false;  ///< frames may have a time budget
  bool with_rays = false;         ///< frames may have ambient rays, and cast_rays() may be called
  /// The same as with_rays, and bounce_rays; 8 bytes a ray on a device, 68 with with_surfaces.
  bool with_bounce = false;
  /// Most FrameRequest::surfaces of a frame, 0 to 8. On a device, each takes 36 bytes a ray.
  std::uint32_t with_surfaces = 0;
  /// The volume is a segmentation: voxels are labels, exact integers from 0 to 65,535, and frames
  /// have surfaces of labels alone (Surface::labels). Needs with_surfaces; not with with_levels,
  /// with_bounds and with_time_budget. Other labels than those of the frame before decode
  /// all blocks once. The host draws both without it.
  bool with_labels = false;
  /// A second volume for Appearance::color_by_field, of any grid. It gets up to half the memory.
  std::shared_ptr<const Volume> field{};
};

/// Turns requests into pictures of one volume. The constructor makes a renderer that draws on a
/// device. make_renderer(), make_host_renderer(), make_quick_renderer() and make_team_renderer()
/// make renderers whose pictures have the same bits. Several threads may share a renderer: its
/// frames take turns.
class Renderer {
 public:
  /// Uploads the compressed volume to the device, unless the volume does not fit, and compiles the
  /// kernels. Keeps device and volume alive.
  ///
  /// Throws  Error: not enough memory (names how much would be enough), options out of range
  Renderer(std::shared_ptr<Device> device, std::shared_ptr<const Volume> volume,
           const RendererOptions &options = {});
  ~Renderer();
  Renderer(Renderer &&) noexcept;
  Renderer &operator=(Renderer &&) noexcept;

  /// Draws a frame and waits for it. Decoded blocks are kept for further frames.
  ///
  /// Throws  Error: a request that the renderer was not made for, a degenerate camera, a NaN, a
  ///         file that cannot be read. The renderer can draw further frames afterwards
  Frame render(const FrameRequest &request);

  /// Finds the first hit of each ray in the finest level of detail. Returns a frame of one row with
  /// depth (in lengths of the ray's direction), normals, positions and hits. A device needs
  /// with_rays.
  ///
  /// Throws  Error: the isovalue is NaN; a ray is not finite, has no direction, or begins more than
  ///         1e7 voxels away from the volume's origin; float32 does not hold a hit's depth, because
  ///         the direction is too short; the renderer is a team's
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals = Normals::kSmooth);

  /// A view from the front right and above in which the isosurface fills a picture of that size
  /// (none: of the largest size). If there is no surface, the volume fills the picture.
  Camera camera(double isovalue, std::optional<ImageSize> size = {});
  /// The same for all surfaces of a frame together.
  Camera camera(const std::vector<Surface> &surfaces, std::optional<ImageSize> size = {});
  /// Views once around the surfaces, about the world axis +y, from so far that the surfaces are in
  /// all pictures. The first view is from where camera() looks, and each is turned on by 360 /
  /// num_views degrees.
  ///
  /// Throws  Error: num_views is not 1 to 100,000
  std::vector<Camera> turntable(const std::vector<Surface> &surfaces, std::uint32_t num_views,
                                std::optional<ImageSize> size = {});

  /// Whether the renderer was made for such requests.
  bool can_draw(const FrameRequest &request) const;

  /// Whether the device can draw. Always true, except that a renderer of make_quick_renderer()
  /// still compiles kernels at first.
  bool ready() const;
  /// Whether render() draws such a request without waiting until ready().
  bool ready_for(const FrameRequest &request) const;
  /// Waits until ready().
  ///
  /// Throws  Error: the device's renderer could not be made
  void wait() const;
  /// Compiles no more kernels after the current one. Returns at once. Unless the renderer was
  /// ready, calls that need the device then throw Error.
  void give_up();

  const std::shared_ptr<Device> &device() const;        ///< null on the host, and for a team
  const std::shared_ptr<const Volume> &volume() const;  ///< null for a team
  const DeviceInfo &device_info() const;                ///< of this process; empty on the host
  const Grid &grid() const;                             ///< grid of the whole volume
  /// As Volume::notices() and Volume::isovalue_notice().
  const std::vector<std::string> &notices() const;
  std::string isovalue_notice(double isovalue) const;
  /// Memory that the renderer holds [bytes]: on the device, 0 before ready(); or on the host, for
  /// value ranges and decoded blocks, without the 36 bytes a ray of the current frame.
  std::uint64_t memory_bytes() const;
  double setup_ms() const;  ///< wall clock of uploads, without compiling

  struct Implementation;
  /// Not for users.
  explicit Renderer(std::unique_ptr<Implementation> implementation);

 private:
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isowave
