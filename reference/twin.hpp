#pragma once
// The twin of a renderer: whole frames of a compressed volume, decoded by libzfp and traced by the
// scalar renderer.

#include <vector>

#include "core/stages/solvers.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave {

class Twin {
 public:
  /// Decodes the volume, and its coarser levels where voxel_pixels, as FrameRequest's, is not
  /// 0. voxel_error, bound: as FrameRequest's. Throws
  /// Error: what check_levels() throws.
  explicit Twin(const CompressedVolume &volume, double voxel_pixels = 0, double voxel_error = 0,
                FieldBound bound = FieldBound::kNone);

  /// The hits [height * width] that a renderer must find, bit for bit.
  std::vector<HitRecord> render(const Camera &camera, ImageSize size, float isovalue,
                                Solver solver = kDefaultSolver) const;

 private:
  double max_pixel_error_;
  std::vector<VolumeInfo> levels_;
  std::vector<std::vector<float>> voxels_;  ///< of each level
};

}  // namespace isowave
