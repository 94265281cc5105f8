#include "reference/twin.hpp"

#include "core/frame/ambient_rays.hpp"
#include "reference/scalar_renderer.hpp"

namespace isowave::core {

namespace {

/// Adds to the voxels of each block what its values are lowered or raised by.
void add_offset(const CompressedVolume &level, const ValueOffset &offset,
                std::vector<float> &voxels) {
  const glm::uvec3 dims = level.info.dims, blocks = level.num_blocks();
  float *value = voxels.data();
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x, ++value) {
        const std::size_t block = x / 4 + blocks.x * (y / 4 + std::size_t{blocks.y} * (z / 4));
        *value += offset_of_voxel(offset, level.bounds, block, x % 4 + 4 * (y % 4) + 16 * (z % 4));
      }
    }
  }
}

}  // namespace

Twin::Twin(const CompressedVolume &volume, double voxel_pixels, double voxel_error,
           FieldBound bound)
    : voxel_pixels_(voxel_pixels) {
  check_voxel_pixels(voxel_pixels);
  if (voxel_pixels > 0) check_has_levels(volume);
  for (const CompressedVolume *level : levels_of(volume, voxel_pixels > 0)) {
    const double level_error = voxel_error_of(voxel_error, levels_.size());
    levels_.push_back(level->info);
    voxels_.push_back(decode_with_libzfp(*level, level_error));
    if (bound == FieldBound::kNone) continue;
    const ValueOffset offset =
        value_offset({*level, level == &volume}, bound, plane_error(level->precision, level_error),
                     volume.value_range);
    add_offset(*level, offset, voxels_.back());
  }
}

std::vector<HitRecord> Twin::render(const Camera &camera, ImageSize size, float isovalue,
                                    Solver solver, Normals normals, const Clip &clip) const {
  const std::vector<FrameParams> frames =
      make_level_frames(levels_, camera, size, isovalue, voxel_pixels_);
  std::vector<HitRecord> hits = render_scalar_levels(
      frames, voxels_, solver, 0, make_clip_params(levels_[0], frames[0].view, camera, clip));
  if (normals == Normals::kSmooth) smooth_gradients(frames, voxels_, hits);
  return hits;
}

OpenCounts Twin::open(const Camera &camera, ImageSize size, float isovalue,
                      const std::vector<HitRecord> &hits, std::uint32_t num_rays, Solver solver,
                      const Clip &clip) const {
  check_ambient_rays(num_rays);
  const std::vector<FrameParams> frames =
      make_level_frames(levels_, camera, size, isovalue, voxel_pixels_);
  return {count_open(frames, levels_, voxels_, hits, num_rays, solver, 0,
                     make_clip_params(levels_[0], frames[0].view, camera, clip)),
          num_rays};
}

}  // namespace isowave::core
