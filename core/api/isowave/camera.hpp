#pragma once
// Cameras and sizes of pictures.

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

struct ImageSize {
  std::uint32_t width = 1280, height = 720;  ///< pixels
  std::uint32_t samples = 1;  ///< rays per pixel along each axis, 1 to 8; colours are their mean
};

}  // namespace isowave
