#pragma once
// The twin of a renderer: whole frames of a compressed volume, decoded by libzfp and traced by the
// scalar renderer.

#include <vector>

#include "core/frame/ambient_rays.hpp"
#include "core/frame/appearance.hpp"
#include "core/frame/normals.hpp"
#include "core/frame/solvers.hpp"
#include "core/frame/surfaces.hpp"
#include "core/view/clip.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "reference/field_twin.hpp"

namespace isowave::core {

/// A frame of several or translucent surfaces, and slices.
struct LayeredFrame {
  /// [layer] hits [height * width], with their surfaces; none that is not blended.
  std::vector<std::vector<HitRecord>> layers;
  std::vector<HitRecord> first_hits;  ///< [height * width] each ray's first of them
  std::vector<RayColor> colors;       ///< [height * width] the layers, blended
  LayerStats stats{};
};

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

  /// How open such hits are, and how lit, of a renderer's frame with such rays.
  OpenCounts open(const Camera &camera, ImageSize size, float isovalue,
                  const std::vector<HitRecord> &hits, const LightRays &rays,
                  Solver solver = kDefaultSolver, const Clip &clip = {}) const;

  /// The layers that a renderer must find and blend, bit for bit. Finds all hits of each ray with
  /// each surface before it merges them.
  ///
  /// request  has surfaces and a size
  /// field    for its field_values
  LayeredFrame render_layers(const FrameRequest &request, const FieldTwin *field = nullptr) const;

 private:
  double voxel_pixels_;
  std::vector<VolumeInfo> levels_;
  std::vector<std::vector<float>> voxels_;  ///< of each level
};

}  // namespace isowave::core
