#include "reference/twin.hpp"

#include "reference/scalar_renderer.hpp"

namespace isowave {

Twin::Twin(const CompressedVolume &volume, double max_pixel_error, double value_error)
    : max_pixel_error_(max_pixel_error) {
  check_levels(volume, max_pixel_error);
  const auto add = [&](const CompressedVolume &level) {
    levels_.push_back(level.info);
    voxels_.push_back(decode_with_libzfp(level, value_error));
  };
  add(volume);
  if (max_pixel_error == 0) return;
  for (const CompressedVolume &level : volume.coarser) add(level);
}

std::vector<HitRecord> Twin::render(const Camera &camera, ImageSize size, float isovalue,
                                    Solver solver) const {
  return render_scalar_levels(make_level_frames(levels_, camera, size, isovalue, max_pixel_error_), voxels_,
                              solver);
}

}  // namespace isowave
