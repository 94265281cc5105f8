#pragma once
// Draws frames of one volume on the host, without OpenCL: at once, where a device's renderer would
// wait for its kernels to be compiled, and where there is no device.

#include <cstdint>
#include <memory>
#include <span>

#include "isowave/frame.hpp"
#include "isowave/volume.hpp"

namespace isowave {

struct HostRendererOptions {
  /// Of value ranges and decoded blocks [bytes]; 0: a quarter of the host's memory. Ranges take
  /// 0.17 bytes a voxel. Frames are the same with any limit; where the blocks that a frame needs, 4
  /// bytes a voxel, pass it, they are decoded more than once.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;  ///< 0: one per processor. The result is the same for any number
};

/// Decodes the blocks that rays come to, and keeps them in host memory. May be used from several
/// threads: frames are drawn one after the other.
class HostRenderer {
 public:
  /// Reads the whole volume for its value ranges. Keeps it alive.
  ///
  /// Throws  Error: the memory limit does not suffice, a file that cannot be read
  explicit HostRenderer(std::shared_ptr<const Volume> volume,
                        const HostRendererOptions &options = {});
  ~HostRenderer();
  HostRenderer(HostRenderer &&) noexcept;
  HostRenderer &operator=(HostRenderer &&) noexcept;

  /// Draws a frame: the bits of Renderer::render(), picture, depth, normals and hits.
  ///
  /// request  without voxel_pixels, voxel_error, bound, max_surface_error, time_budget_ms and
  ///          want_bounds. on_pass is called after each band of rows, from the top, from the
  ///          calling thread; where it returns false, the rows below show the background.
  /// Throws   Error: others, a degenerate camera, a NaN, a file that cannot be read; further frames
  ///          are drawn as if it had not been
  Frame render(const FrameRequest &request);
  /// Whether render() draws such a request.
  static bool can_draw(const FrameRequest &request);

  /// Where rays of any origin and direction first cross the isosurface.
  ///
  /// Returns  one row of rays.size() columns: depth, in lengths of the ray's direction; normals,
  ///          positions and hits; no picture
  /// Throws   Error: the isovalue is NaN; a ray is not finite, has no direction, or begins more
  ///          than 1e7 voxels from the volume's origin; a hit is so many lengths of the direction
  ///          away that float32 does not hold the depth; a file cannot be read
  Frame cast_rays(std::span<const Ray> rays, double isovalue, Normals normals = Normals::kSmooth);

  /// The view that Renderer::camera() takes, for a picture of that size.
  Camera camera(double isovalue, const ImageSize &size = {}) const;

  const std::shared_ptr<const Volume> &volume() const;
  /// At present, of value ranges and decoded blocks; a frame's rays take 36 each.
  std::uint64_t memory_bytes() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isowave
