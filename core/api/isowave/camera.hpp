#pragma once
// Cameras, sides from which volumes are seen, and sizes of pictures.

#include <array>
#include <cstdint>
#include <optional>

namespace isowave {

/// x, y, z
using Vector3 = std::array<double, 3>;

/// A camera in world space: a pinhole, or parallel projection.
struct Camera {
  Vector3 eye{0, 0, 1}, at{0, 0, 0}, up{0, 1, 0};
  double fovy_degrees = 60;  ///< full angle between the picture's lower and upper edge, 0 to 180
  /// Height of the picture in parallel (orthographic) projection [world units]; none: a pinhole.
  /// Depth is then the distance from the eye's plane, and surfaces behind that plane are not seen.
  std::optional<double> parallel_height{};
};

/// Side of a volume from which it is seen. Left and right of a patient (Grid::is_anatomical) are
/// the patient's own; of other volumes, as one who looks from the front sees them.
enum class Side : std::uint8_t {
  kCorner,  ///< from the front right and above
  kFront,
  kBack,
  kLeft,
  kRight,
  kTop,
  kBottom,
  kIso  ///< from the front right and above, where all three edges look equally long
};

/// How a volume is looked at.
struct Viewpoint {
  Side side = Side::kCorner;
  /// Direction of the world that is up; none: up_of() the volume's grid.
  std::optional<Vector3> up{};
  double zoom = 1;  ///< 0.01 to 1000: the picture is magnified about its middle
};

struct ImageSize {
  std::uint32_t width = 1280, height = 720;  ///< pixels
  std::uint32_t samples = 1;  ///< rays per pixel along each axis, 1 to 8; colours are their mean
};

}  // namespace isowave
