#pragma once
// What a frame is asked for.

#include <cstdint>
#include <functional>
#include <optional>

#include "core/frame/frame_stats.hpp"
#include "core/frame/normals.hpp"
#include "core/view/camera.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/level_bounds.hpp"

namespace isowave::core {

/// Called after each pass, the last included, and those for smooth normals and ambient rays, of
/// which 100 % of the rays are completed; Renderer::hits() and shade() show the picture so far.
/// Return false to stop. With a callback, or with profiling, the host waits after each pass;
/// without, it stays a pass ahead.
using OnPass = std::function<bool(const PassStats &)>;

/// One frame: what to draw, and how precisely. The same request gives the same picture, bit for
/// bit, whatever was drawn before.
struct FrameRequest {
  Camera camera{};
  float isovalue = 0;
  std::optional<ImageSize> size{};  ///< none: the renderer's largest
  /// Voxels of a coarser level of detail may be so many pixels apart, see make_level_frames(); 0:
  /// the finest level draws all.
  double voxel_pixels = 0;
  /// How far the voxels may be from the volume's: 0, not at all; more, and fewer bit planes of each
  /// block are decoded (with_fewer_planes()), of coarser levels of detail fewer still
  /// (voxel_error_of()).
  double voxel_error = 0;
  /// What is drawn: the volume, or the field that is nowhere above, or nowhere below what the
  /// volume's voxels were before compression, trilinear between them: decoded values are lowered or
  /// raised by the bound of their error.
  FieldBound bound = FieldBound::kNone;
  Normals normals = Normals::kSmooth;  ///< gradients of the hits; nothing else depends on them
  /// Rays of each hit that find out how much of the sky it sees, which shading shows
  /// (kernels_cl/portable/ambient.h); 0: all see all of it.
  std::uint32_t ambient_rays = 0;
  /// Instead of voxel_pixels and voxel_error: chooses them such that most pixels are within so many
  /// pixels of the surface of the volume before compression.
  std::optional<double> max_surface_error{};
  /// Draws what can be drawn in this time: small pictures first.
  std::optional<double> time_budget_ms{};
  OnPass on_pass{};
};

/// The same request from another place.
inline FrameRequest seen_from(const Camera &camera, FrameRequest request) {
  request.camera = camera;
  return request;
}

/// The same request with a time budget [ms].
inline FrameRequest within_ms(double time_budget_ms, FrameRequest request) {
  request.time_budget_ms = time_budget_ms;
  return request;
}

/// The request with this detail.
inline FrameRequest with_detail(FrameRequest request, const Detail &detail) {
  request.voxel_pixels = detail.voxel_pixels;
  request.voxel_error = detail.voxel_error;
  return request;
}

}  // namespace isowave::core
