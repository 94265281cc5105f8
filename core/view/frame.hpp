#pragma once
// One frame's constants for kernels and twin: grid, camera in index space, isovalue.

#include <cstdint>
#include <vector>

#include "core/view/camera.hpp"
#include "core/volume/volume.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// A picture, and the grid of its rays: that of a picture with samples times as many pixels along
/// both axes. Frames and hit buffers count rays; the picture has the mean colour of each pixel's
/// (kernels_cl/shade.cl).
struct ImageSize {
  std::uint32_t width = 1280, height = 720;  ///< pixels
  std::uint32_t samples = 1;                 ///< rays of a pixel along each axis, 1..kMaxSamples
  /// Odd. Above 1, only a sample of the rays is drawn: one in each square of stride x stride rays
  /// (place_of_ray()), and a few beside the picture (is_in_picture()). A sample has no picture.
  std::uint32_t stride = 1;

  static constexpr std::uint32_t kMaxSamples = 8, kMaxStride = 255;
  std::uint64_t num_pixels() const { return std::uint64_t(width) * height; }
  std::uint32_t ray_columns() const { return in_sample(width * samples); }
  std::uint32_t ray_rows() const { return in_sample(height * samples); }
  std::uint64_t num_rays() const { return std::uint64_t(ray_columns()) * ray_rows(); }
  friend bool operator==(const ImageSize &, const ImageSize &) = default;

 private:
  /// The squares' middle is the picture's, so both are odd or even numbers of rays wide.
  std::uint32_t in_sample(std::uint32_t rays) const {
    if (stride == 1) return rays;
    const std::uint32_t squares = (rays + stride - 1) / stride;
    return squares + (squares + rays) % 2;
  }
};

/// Throws  Error: an image of 0 pixels, more than 2^28 rays, samples or stride out of range
void check_image_size(ImageSize size);

/// A picture of half the rays, so many times, along each axis, rounded up: one for each pixel. 0
/// times: the picture itself.
inline ImageSize halved(ImageSize size, unsigned times) {
  if (times == 0) return size;
  const auto half = [times](std::uint32_t rays) { return ((rays - 1) >> times) + 1; };
  return {half(size.ray_columns()), half(size.ray_rows())};
}

/// Blocks along an axis of `dim` voxels that own dual cells: all but a last one of a single voxel
/// layer.
inline std::uint32_t num_owning_blocks(std::uint32_t dim) {
  return (dim + 2) / 4;
}

inline std::uint64_t block_count(const BlockGrid &grid) {
  return std::uint64_t{grid.blocks_x} * grid.blocks_y * grid.blocks_z;
}

/// Coarse macrocells (kernels_cl/macrocells.cl).
inline std::uint64_t num_macrocells(const BlockGrid &grid) {
  const auto cells = [](std::uint32_t blocks) {
    return (std::uint64_t{blocks} + ISO_MACROCELL_BLOCKS - 1) / ISO_MACROCELL_BLOCKS;
  };
  return cells(grid.blocks_x) * cells(grid.blocks_y) * cells(grid.blocks_z);
}

/// what    names the volume
/// Throws  Error: distances within the volume, or directions, do not fit float32, or its origin is
///         so far away that voxels are lost beside it
void check_distances(const VolumeInfo &info, std::string_view what);
/// For volumes that one device draws, be it as a brick of a larger one.
///
/// Throws  Error: as check_distances(); more blocks than have ids
void check_drawable(const VolumeInfo &info, std::string_view what);

BlockGrid make_grid(const VolumeInfo &info);

/// Constants of a volume without levels of detail, for work that needs no camera.
FrameParams make_grid_params(const VolumeInfo &info);

/// Computes the camera basis once, in double, and maps it to index space.
///
/// camera  in world space
/// Throws  Error: a degenerate camera, or one too far away; what check_distances() or
///         check_image_size() refuses
View make_view(const VolumeInfo &info, const Camera &camera, ImageSize size);

/// Whether a ray of a sample is one of the picture's.
///
/// view  make_view() of that size
bool is_in_picture(const View &view, ImageSize size, std::uint32_t ray);

/// The rays, as make_ray() rounds them, that may meet the surface's active box, by a frame's grid,
/// brick, view and surface.
ScreenBox make_screen_box(const FrameParams &frame);

/// A frame in which the whole volume is active, without speculation and without a cache: what the
/// scalar reference needs.
///
/// Throws  Error: what make_view() throws; a NaN isovalue
FrameParams make_frame_params(const VolumeInfo &info, const Camera &camera, ImageSize size,
                              float isovalue);

/// Depth of each hit, world units, INFINITY where nothing is hit.
std::vector<float> depth_of(const std::vector<HitRecord> &hits);

}  // namespace isowave::core
