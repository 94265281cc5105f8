#pragma once
// Where a picture is taken from.

#include <array>
#include <cstdint>

namespace isowave {

/// x, y, z
using Vector3 = std::array<double, 3>;

/// A pinhole camera in world space.
struct Camera {
  Vector3 eye{0, 0, 1}, at{0, 0, 0}, up{0, 1, 0};
  double fovy_degrees = 60;  ///< full angle between the picture's lower and upper edge, 0 to 180
};

struct ImageSize {
  std::uint32_t width = 1280, height = 720;  ///< pixels
  std::uint32_t samples = 1;  ///< rays of a pixel along each axis, 1 to 8; colours are their mean
};

}  // namespace isowave
