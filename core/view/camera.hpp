#pragma once
// Cameras, their files, and the default orbit.

#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "core/volume/volume.hpp"

namespace isowave::core {

/// Most views around a volume that can be asked for.
inline constexpr std::uint32_t kMostViews = 100'000;

/// A camera in world space: a pinhole, or parallel projection.
struct Camera {
  glm::dvec3 eye{0.0}, at{0.0, 0.0, -1.0}, up{0.0, 1.0, 0.0};
  double fovy_deg = 60.0;  ///< pinhole: the full vertical angle
  /// Parallel projection: height of the picture [world units]; depth is the distance from the eye's
  /// plane, and what is behind that is not seen.
  std::optional<double> parallel_height{};

  friend bool operator==(const Camera &, const Camera &) = default;
};

/// A camera file (JSON): `{"dims":[..],"spacing":[..],"width":W,"height":H,"fovy_deg":F,
/// "cameras":[{"eye":[..],"at":[..],"up":[..]}]}`. dims, spacing, width and height are optional;
/// a camera with "parallel_height":H is in parallel projection.
struct CameraFile {
  std::optional<glm::uvec3> dims;
  std::optional<glm::dvec3> spacing;
  std::optional<std::uint32_t> width, height;
  std::vector<Camera> cameras;
};

/// Throws  Error: unreadable, not JSON, a field missing or of a wrong type, eye == at, up parallel
///         to the view, fovy outside (0,180), no cameras
CameraFile read_camera_file(const std::filesystem::path &path);
/// Throws  Error: the camera is degenerate (see read_camera_file); `what` names it
void check_camera(const Camera &camera, std::string_view what);

/// Directions of length 1, at right angles to each other, in world space.
struct CameraAxes {
  glm::dvec3 forward, right, up;
};
CameraAxes axes_of(const Camera &camera);

/// The camera, moved around what it looks at, about the axis `up`.
Camera turned(const Camera &camera, double degrees);
/// The camera, whose rays all pass beside its own: turned about its eye, or moved in parallel
/// projection.
///
/// pixels  to the right and up, as pixel_size_at() counts them
/// height  of the picture [pixels]
Camera aside(const Camera &camera, const glm::dvec2 &pixels, std::uint32_t height);
/// The same view in parallel projection, in which what is as far away as `at` has the same size.
Camera in_parallel(const Camera &camera);
/// The height of a pixel at a distance from the eye [world units].
///
/// height  of the picture [pixels]
double pixel_size_at(const Camera &camera, std::uint32_t height, double distance);

/// The point that a ray passes at a distance from the eye, or in parallel projection from its plane
/// [world units].
///
/// pixels  from the middle of the picture, to the right and up
/// height  of the picture [pixels]
glm::dvec3 point_of_ray(const Camera &camera, const glm::dvec2 &pixels, std::uint32_t height,
                        double distance);

/// A view of a box from the front right and above, where orbit_cameras() begins, in which it fills
/// the picture to `margin` of it.
///
/// begin, end  corners of the box [voxels], index space
/// aspect      width of the picture / its height
/// num_views   from so far that the box is in each view of turntable()
Camera camera_of_box(const VolumeInfo &info, const glm::dvec3 &begin, const glm::dvec3 &end,
                     double aspect, std::uint32_t num_views = 1, double margin = 0.95);

/// n views once around what the first of them looks at, about its axis `up`, anticlockwise from
/// above: view k is turned by 360 k/n degrees.
std::vector<Camera> turntable(const Camera &first, std::uint32_t n);

/// n eyes about the world +y axis through the box centre: azimuth 2*pi*k/n + 0.3 (0 looks from +z;
/// x grows with sin), elevation 20 degrees, distance 0.8 box diagonals from the box centre,
/// fovy 60. The box spans index [0, dims-1] mapped to world.
std::vector<Camera> orbit_cameras(const VolumeInfo &info, std::uint32_t n);

}  // namespace isowave::core
