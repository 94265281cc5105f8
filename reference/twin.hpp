#pragma once
// The twin of a renderer: whole frames of a compressed volume, decoded by libzfp and traced by the
// scalar renderer.

#include <vector>

#include "core/frame/appearance.hpp"
#include "core/frame/normals.hpp"
#include "core/frame/solvers.hpp"
#include "core/view/clip.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

class Twin {
 public:
  /// Decodes the volume, and its coarser levels where voxel_pixels is not 0. The arguments are
  /// those of FrameRequest.
  ///
  /// Throws  Error as DeviceRenderer does
  explicit Twin(const CompressedVolume &volume, double voxel_pixels = 0, double voxel_error = 0,
                FieldBound bound = FieldBound::kNone);

  /// The hits [height * width] that a renderer must find, bit for bit.
  std::vector<HitRecord> render(const Camera &camera, ImageSize size, float isovalue,
                                Solver solver = kDefaultSolver, Normals normals = Normals::kSmooth,
                                const Clip &clip = {}) const;

  /// How open such hits are, of a renderer's frame with ambient rays.
  OpenCounts open(const Camera &camera, ImageSize size, float isovalue,
                  const std::vector<HitRecord> &hits, std::uint32_t num_rays,
                  Solver solver = kDefaultSolver, const Clip &clip = {}) const;

 private:
  double voxel_pixels_;
  std::vector<VolumeInfo> levels_;
  std::vector<std::vector<float>> voxels_;  ///< of each level
};

}  // namespace isowave::core
