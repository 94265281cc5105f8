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

/// Turns requests into pictures of one volume. The constructor makes one that draws on a device;
/// make_host_renderer(), make_quick_renderer() and make_team_renderer() make others, whose pictures
/// have the same bits. May be used from several threads: frames are drawn one after the other.
class Renderer {
 public:
  /// Brings the compressed volume to the device, or what of it is needed if it does not fit, and
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
  /// Throws  Error: a request that the renderer was not made for, a degenerate camera, a NaN; a
  /// file
  ///         that cannot be read. Further frames are drawn as if it had not been
  Frame render(const FrameRequest &request);

  /// The first hit of each ray, in the finest level of detail: from a frame of one row, with depth
  /// (in lengths of the ray's direction), normals, positions and hits. A device needs with_rays.
  ///
  /// Throws  Error: the isovalue is NaN; a ray is not finite, has no direction, or begins more than
  ///         1e7 voxels away from the volume's origin; a hit is so many lengths of the direction
  ///         away that float32 does not hold the depth; the renderer is a team's
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals = Normals::kSmooth);

  /// A view from the front right and above in which the isosurface fills a picture of that size
  /// (none: of the largest); the volume, if there is no surface.
  Camera camera(double isovalue, std::optional<ImageSize> size = {});

  /// Whether the renderer was made for such requests.
  bool can_draw(const FrameRequest &request) const;

  /// Whether kernels are no longer being compiled: always, but for make_quick_renderer().
  bool ready() const;
  /// Whether render() draws such a request without waiting until ready().
  bool ready_for(const FrameRequest &request) const;
  /// Waits until ready().
  ///
  /// Throws  Error: what went wrong when the device's renderer was made
  void wait() const;
  /// Compiles no more kernels after the one at work. Returns at once; afterwards, unless the
  /// renderer was ready, calls that need the device throw Error.
  void give_up();

  const std::shared_ptr<Device> &device() const;        ///< null: on the host, or a team's
  const std::shared_ptr<const Volume> &volume() const;  ///< null: a team's
  const DeviceInfo &device_info() const;                ///< of this process; empty on the host
  const Grid &grid() const;                             ///< of the whole volume
  /// As Volume::notices() and Volume::isovalue_notice().
  const std::vector<std::string> &notices() const;
  std::string isovalue_notice(double isovalue) const;
  /// Memory that the renderer holds [bytes]: of the device, 0 before ready(); on the host of value
  /// ranges and decoded blocks, while a frame's rays take 36 each.
  std::uint64_t memory_bytes() const;
  double setup_ms() const;  ///< wall clock of uploads, without compiling

  struct Implementation;
  /// Not for users.
  explicit Renderer(std::unique_ptr<Implementation> implementation);

 private:
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isowave
