#pragma once
// A request of a frame.

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/frame/frame_stats.hpp"
#include "core/frame/normals.hpp"
#include "core/frame/surfaces.hpp"
#include "core/view/camera.hpp"
#include "core/view/clip.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/level_bounds.hpp"

namespace isowave::core {

/// Called after each pass, also after the last one and those for smooth normals and ambient rays
/// (which state 100 % of the rays as completed). Renderer::hits() and shade() show the picture so
/// far. If it returns false, the frame stops. With a callback, or with profiling, the host waits
/// after each pass; otherwise the host stays a pass ahead.
using OnPass = std::function<bool(const PassStats &)>;

/// Called now and then, by the thread that draws, with the percentage of the frame's work that is
/// done, as if each ray of light took as long as one of the camera. Neither the frame nor its
/// statistics depend on it, and the host waits for nothing more. It may fall if a SoonRenderer
/// begins anew.
using OnProgress = std::function<void(double percent)>;

/// The evidence for a largest surface error (core/accuracy/choose_detail.hpp).
enum class Evidence {
  kProof,  ///< bounds of most pixels, against the volume before compression
  kSample  ///< a sample of the frame's rays, against full detail
};

/// One frame: what to draw, and how precisely. The same request gives the same picture, bit for
/// bit.
struct FrameRequest {
  Camera camera{};
  float isovalue = 0;
  std::optional<ImageSize> size{};  ///< none: the renderer's largest
  Clip clip{};                      ///< the part of the volume that is drawn
  /// Surfaces that are drawn instead of that of `isovalue`, blended front to back. Empty: that one
  /// alone, opaque.
  std::vector<SurfaceStyle> surfaces{};
  Slices slices{};  ///< beside surfaces
  /// The light of surfaces[]: passes blend it. Renderer::fetch() adds the background. Shadow rays
  /// go to its light. Pictures for max_image_error look like that, too.
  Appearance light{};
  /// Largest distance between voxels of a coarser level of detail [pixels], see
  /// make_level_frames(); 0: the finest level draws all.
  double voxel_pixels = 0;
  /// Largest difference of decoded voxels from the volume's. Above 0, fewer bit planes of each
  /// block are decoded (with_fewer_planes()), and fewer still at coarser levels of detail
  /// (voxel_error_of()).
  double voxel_error = 0;
  /// The field that is drawn: the volume's, or one that is nowhere above, or nowhere below, the
  /// voxels before compression. Decoded values are then lowered or raised by the bound of their
  /// error.
  FieldBound bound = FieldBound::kNone;
  Normals normals = Normals::kSmooth;  ///< gradients of the hits; nothing else depends on them
  /// Whether hits get values of the renderer's field, for Appearance::color_by_field.
  bool field_values = false;
  bool field_on_caps = false;  ///< hits that are no caps have no value
  /// The field's values are labels: hits have that of the nearest voxel with another label than 0,
  /// or if the field is the volume whose labels are drawn, with a label of the hit's surface.
  bool field_labels = false;
  /// Rays from each hit that find out how much of the sky it sees, for shading
  /// (kernels_cl/portable/ambient.h); 0: each hit sees all of it.
  std::uint32_t ambient_rays = 0;
  /// Rays from each hit towards light.towards_light, for its shadows; 0: it casts none. A single
  /// ray gives hard shadows; several are spread over a cone around that direction, for soft ones.
  std::uint32_t shadow_rays = 0;
  /// Least number of ambient rays if light.towards_light bounces: each hit gets light of it that
  /// comes by way of one other place of the surface (kernels_cl/portable/bounce.h), by its ambient
  /// rays. 0: it does not bounce.
  std::uint32_t bounce_rays = 0;
  double light_angle = 3;  ///< of the cone, from its axis [degrees], up to 45
  /// Largest distance to the true surface [pixels]. voxel_pixels and voxel_error are then chosen so
  /// that most pixels keep it. The true surface is that of the volume before compression, or by
  /// sample that of full detail.
  std::optional<double> max_surface_error{};
  Evidence by = Evidence::kProof;  ///< for max_surface_error; kProof without one
  /// Largest error of the picture: the mean of FLIP's over all pixels (core/accuracy/flip.hpp),
  /// against 64 rays a pixel at full detail. The rays of a pixel, up to those of `size`, and
  /// voxel_pixels are then chosen, by tiles of the picture that `light` describes.
  std::optional<double> max_image_error{};
  /// Views that share max_surface_error or max_image_error: most pixels of all of them together, or
  /// the mean of their pictures, keep it. They are drawn with one detail, which is chosen once.
  /// Empty: this view alone.
  std::vector<Camera> series{};
  /// Time in which the largest picture possible is drawn (timed_renderer.hpp).
  std::optional<double> time_budget_ms{};
  OnPass on_pass{};
  OnProgress on_progress{};  ///< not called within a time budget
};

/// The same request with another camera.
inline FrameRequest seen_from(const Camera &camera, FrameRequest request) {
  request.camera = camera;
  return request;
}

/// The same request without ambient, shadow and bounce rays.
inline FrameRequest without_light_rays(FrameRequest request) {
  request.ambient_rays = request.shadow_rays = request.bounce_rays = 0;
  return request;
}

/// The same request with a time budget [ms].
inline FrameRequest within_ms(double time_budget_ms, FrameRequest request) {
  request.time_budget_ms = time_budget_ms;
  return request;
}

/// The same request without calls back.
inline FrameRequest without_calls(FrameRequest request) {
  request.on_pass = {};
  request.on_progress = {};
  return request;
}

/// The request without a largest error.
inline FrameRequest without_error(FrameRequest request) {
  request.max_surface_error.reset();
  request.max_image_error.reset();
  request.by = Evidence::kProof;
  request.series.clear();
  return request;
}

/// The request with this detail.
inline FrameRequest with_detail(FrameRequest request, const Detail &detail) {
  request.voxel_pixels = detail.voxel_pixels;
  request.voxel_error = detail.voxel_error;
  return request;
}
/// The request with what was chosen for its largest error, and without that.
///
/// largest  size of a request without one
inline FrameRequest as_chosen(FrameRequest request, const DetailChoice &choice, ImageSize largest) {
  request = with_detail(without_error(std::move(request)), choice.detail);
  if (choice.image) {
    request.size = request.size.value_or(largest);
    request.size->samples = choice.image->samples;
  }
  return request;
}

}  // namespace isowave::core
