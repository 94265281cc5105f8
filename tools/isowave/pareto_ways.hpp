#pragma once
// The ways to draw that `isowave bench pareto` measures: what users can ask for, and the renderer
// and the request of each.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/ocl/device.hpp"
#include "core/paper/mesh_renderer.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

enum class DrawnBy {
  kDevice,
  kHost,
  kTriangles  ///< Block-Compressed Marching Cubes on the device (MeshRenderer)
};

/// One way to draw.
struct ParetoWay {
  std::string name;                            ///< its options of `render`, or what it is
  std::optional<std::uint32_t> rate{};         ///< --rate; or
  std::optional<double> tolerance_relative{};  ///< --tolerance-relative; else lossless
  DrawnBy drawn_by = DrawnBy::kDevice;
  std::string pipeline = "rays", solver{to_string(kDefaultSolver)};
  std::uint32_t samples = 1;
  std::uint32_t shrunk = 1;  ///< the picture has this part of the size, and is enlarged
  double voxel_pixels = 0;
  double voxel_error = 0;  ///< as a part of the range of values
  std::optional<double> max_surface_error{}, max_image_error{}, time_budget_ms{};
  Evidence by = Evidence::kProof;  ///< of max_surface_error
  Normals normals = Normals::kSmooth;
  std::uint32_t ambient_rays = 0;

  bool needs_bounds() const { return max_surface_error && by == Evidence::kProof; }
  bool needs_levels() const { return voxel_pixels > 0 || max_surface_error || max_image_error; }
};

/// All of them, the default first.
const std::vector<ParetoWay> &pareto_ways();

/// Makes the renderer of a way.
///
/// device, volume  must outlive it
/// size            of the picture that is shown
std::unique_ptr<Renderer> make_renderer(ocl::Device &device, const CompressedVolume &volume,
                                        const ParetoWay &way, ImageSize size);

/// The size of a way's own picture.
ImageSize size_of(const ParetoWay &way, ImageSize shown);

/// value_range  largest minus smallest value of the volume
FrameRequest request_of(const ParetoWay &way, ImageSize shown, float isovalue, double value_range);

}  // namespace isowave::core::tools
