#include "reference/embree_reach.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace isowave::core {

double farthest_plane(const std::array<double, 3> &eye, const std::array<std::uint32_t, 3> &dims) {
  double farthest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    farthest = std::max({farthest, std::abs(eye[axis]), std::abs(eye[axis] - (dims[axis] - 1.0))});
  }
  return farthest;
}

bool within_embree_reach(const std::array<double, 3> &eye,
                         const std::array<std::uint32_t, 3> &dims) {
  return farthest_plane(eye, dims) <= kEmbreeReach;
}

std::string out_of_reach(const std::array<double, 3> &eye,
                         const std::array<std::uint32_t, 3> &dims) {
  return fmt::format(
      "the eye is {:.0f} voxels from the volume's far side: Embree's float32 can be trusted to "
      "{:.0f}",
      farthest_plane(eye, dims), kEmbreeReach);
}

}  // namespace isowave::core
