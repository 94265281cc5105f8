#pragma once
// Cameras, their files, and views of volumes from all sides.

#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>
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
/// where  names the text in errors
CameraFile parse_camera_file(std::string_view text, const std::string &where);
/// The text of a camera file for pictures of that size. It names no volume, so it is for all.
///
/// Throws  Error: the cameras' fovy_deg differ: a file has one
std::string camera_file_text(const std::vector<Camera> &cameras, std::uint32_t width,
                             std::uint32_t height);
/// Throws  Error: the camera is degenerate (see read_camera_file); `what` names it
void check_camera(const Camera &camera, std::string_view what);

/// Directions of length 1, at right angles to each other, in world space.
struct CameraAxes {
  glm::dvec3 forward, right, up;
};
CameraAxes axes_of(const Camera &camera);

/// The camera, moved around what it looks at.
///
/// axis  none: the camera's own `up`
Camera turned(const Camera &camera, double degrees, const std::optional<glm::dvec3> &axis = {});
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

/// Side of a volume from which it is seen. README.md says where the sides are.
enum class Side : std::uint8_t {
  kCorner,  ///< from the front right and above, where orbit_cameras() begins
  kFront,
  kBack,
  kLeft,
  kRight,
  kTop,
  kBottom,
  kIso  ///< as far to the right of the front as above it: all three edges look equally long
};

/// How a volume is looked at.
struct Viewpoint {
  Side side = Side::kCorner;
  std::optional<glm::dvec3> up{};  ///< direction of the world that is up; none: the volume's
  double zoom = 1;                 ///< see zoomed()
  std::uint32_t num_views = 1;     ///< of a turntable() about up: the box is in all pictures
};

/// Directions of length 1 in world space, at right angles to each other: to the right of what is
/// seen from the front, up, and towards an eye in front.
struct Orientation {
  glm::dvec3 right, up, front;
};

/// The orientation of a volume: superior is up and anterior is in front if its world is a
/// patient's, else +y is up and +z is in front. If another direction is up, all three are turned to
/// it, by the smallest angle.
///
/// Throws  Error: `up` is not finite, or has no length
Orientation orientation_of(const VolumeInfo &info, const std::optional<glm::dvec3> &up = {});

/// A view of a box, in which it fills the picture to kMargin of it.
///
/// begin, end  corners of the box [voxels], index space
/// aspect      width of the picture / its height
/// Throws      Error: what orientation_of() and zoomed() throw
Camera camera_of_box(const VolumeInfo &info, const glm::dvec3 &begin, const glm::dvec3 &end,
                     double aspect, const Viewpoint &from = {});
inline constexpr double kMargin = 0.95;

/// The camera, moved back and forth, and aside, until a volume's box fills the picture. In parallel
/// projection, the picture's height changes, too.
///
/// aspect  width of the picture / its height
/// Throws  Error: a degenerate camera
Camera fitted(const Camera &camera, const VolumeInfo &info, double aspect);

/// The camera, whose picture is magnified about its middle, without moving the eye.
///
/// zoom    above 1: what is seen gets larger
/// Throws  Error: zoom is not 0.01 to 1000
Camera zoomed(const Camera &camera, double zoom);

/// n views once around what the first of them looks at, anticlockwise from above: view k is turned
/// by 360 k/n degrees.
///
/// axis  none: the camera's own `up`
std::vector<Camera> turntable(const Camera &first, std::uint32_t n,
                              const std::optional<glm::dvec3> &axis = {});

/// n eyes about the axis `up` through the box centre: azimuth 2*pi*k/n + 0.3 (0 looks from the
/// front; `right` grows with sin), elevation 20 degrees, distance 0.8 box diagonals from the box
/// centre, or as much further as pictures are narrower than high; fovy 60. The box spans index
/// [0, dims-1] mapped to world.
///
/// up      none: orientation_of()
/// aspect  width of the picture / its height
std::vector<Camera> orbit_cameras(const VolumeInfo &info, std::uint32_t n,
                                  const std::optional<glm::dvec3> &up = {}, double aspect = 1);

}  // namespace isowave::core
