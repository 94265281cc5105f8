#include "core/detail.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_access.hpp>
#include <limits>

#include "core/error.hpp"
#include "core/pyramid.hpp"

namespace isowave {

namespace {

/// Distances from the eye: none to a point of the volume's domain is less than the first or more than the second, a little apart so that no
/// rounding matters [world units].
std::array<double, 2> reach(const VolumeInfo &info, const glm::dvec3 &eye) {
  const glm::dmat3 to_world = info.index_to_world(), to_index = glm::inverse(to_world);
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0, at = to_index * (eye - info.origin);
  double farthest = 0, radius = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 side(corner & 1, corner >> 1 & 1, corner >> 2);
    farthest = std::max(farthest, glm::length(to_world * (last * side - at)));
    radius = std::max(radius, glm::length(to_world * (last * (side - 0.5))));
  }
  double nearest = glm::length(to_world * (0.5 * last - at)) - radius;  // to a ball around it
  for (int axis = 0; axis < 3; ++axis) {                                // and to the planes of its faces
    const double beyond = std::max(-at[axis], at[axis] - last[axis]);
    nearest = std::max(nearest, beyond / glm::length(glm::row(to_index, axis)));
  }
  return {0.999 * std::max(0.0, nearest), 1.001 * farthest};
}

}  // namespace

void check_max_pixel_error(double max_pixel_error) {
  if (!(max_pixel_error >= 0) || !std::isfinite(max_pixel_error))
    throw Error("a distance of {} pixels between voxels cannot be allowed: give 0 or more", max_pixel_error);
}

void check_levels(const CompressedVolume &volume, double max_pixel_error) {
  check_max_pixel_error(max_pixel_error);
  if (max_pixel_error > 0 && volume.coarser.empty() && max_levels(volume.info.dims) > 1) {
    throw Error(
        "the volume has no levels of detail, which {} pixels between voxels need: convert it with --levels",
        max_pixel_error);
  }
}

std::vector<FrameParams> make_level_frames(std::span<const VolumeInfo> levels, const Camera &camera,
                                           ImageSize size, float isovalue, double max_pixel_error) {
  check_max_pixel_error(max_pixel_error);
  std::vector<FrameParams> frames;
  for (const VolumeInfo &info : levels) {
    FrameParams frame = make_frame_params(info, camera, size, isovalue);
    if (!frames.empty()) {
      frame.id_blocks_x = frames[0].blocks_x;
      frame.id_blocks_y = frames[0].blocks_y;
      frame.id_begin_z = frames.back().id_begin_z + frames.back().blocks_z;
      frame.begin_t = frame.end_t = 0.0f;
    }
    frames.push_back(frame);
  }
  if (max_pixel_error == 0 || levels.size() == 1) return frames;

  const VolumeInfo &finest = levels[0];
  const glm::dmat3 to_world = finest.index_to_world();
  const double voxel =
      std::max({glm::length(to_world[0]), glm::length(to_world[1]), glm::length(to_world[2])});
  const double pixel = 2.0 * std::tan(glm::radians(camera.fovy_deg) / 2) / size.height;  // at distance 1
  const auto [nearest, farthest] = reach(levels.back(), camera.eye);
  // Levels' t differ by powers of two, so that their borders are the same in all bits.
  const auto border = [&](std::size_t level, const FrameParams &frame) {
    const double t = std::ldexp(voxel, static_cast<int>(level)) / (max_pixel_error * pixel);
    return static_cast<float>(t / frames[0].t_scale) * (frames[0].t_scale / frame.t_scale);
  };
  const auto world_border = [&](std::size_t level) {
    return double{border(level, frames[0])} * double{frames[0].t_scale};
  };
  std::size_t first = 0, last = levels.size() - 1;
  while (first + 1 < levels.size() && world_border(first + 1) <= nearest) ++first;
  while (last > first && world_border(last) >= farthest) --last;
  frames[0].end_t = 0.0f;
  for (std::size_t level = first; level <= last; ++level) {
    FrameParams &frame = frames[level];
    frame.begin_t = level == first ? 0.0f : border(level, frame);
    frame.end_t = level == last ? std::numeric_limits<float>::infinity() : border(level + 1, frame);
    if (first == last) continue;
    frame.screen_begin_x = frame.screen_begin_y = 0;
    frame.screen_end_x = size.width;
    frame.screen_end_y = size.height;
  }
  return frames;
}

}  // namespace isowave
