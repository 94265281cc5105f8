#include "core/view/clip.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

/// Squares of lengths between 1 / kLongestNormal and kLongestNormal stay in double's range.
constexpr double kLongestNormal = 0x1p500;
/// Distances beyond leave float32 room for t.
constexpr double kFarthestPlane = 0x1p40;

float limited(double distance) {
  return static_cast<float>(std::clamp(distance, -kFarthestPlane, kFarthestPlane));
}

}  // namespace

std::array<ClipPlane, 6> box_planes(const glm::dvec3 &begin, const glm::dvec3 &end) {
  std::array<ClipPlane, 6> planes;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<glm::length_t>(axis);
    if (!(begin[i] < end[i]))
      throw Error("the box that stays ends at {} along {}, and begins at {}", end[i], "xyz"[axis],
                  begin[i]);
    glm::dvec3 normal(0);
    normal[i] = 1;
    planes[2 * axis] = {normal, begin[i]};
    planes[2 * axis + 1] = {-normal, -end[i]};
  }
  return planes;
}

void check_plane(const ClipPlane &plane, std::string_view what) {
  const double length = glm::length(plane.normal);
  if (!(length > 1 / kLongestNormal && length < kLongestNormal))
    throw Error("{}'s normal is {} {} {}: give a direction", what, plane.normal.x, plane.normal.y,
                plane.normal.z);
  if (!std::isfinite(plane.offset))
    throw Error("{}'s offset is {}: give a number", what, plane.offset);
}

void check_clip(const Clip &clip) {
  if (clip.planes.size() > ISO_MAX_CLIP_PLANES)
    throw Error("{} clipping planes: up to {} can be drawn", clip.planes.size(),
                ISO_MAX_CLIP_PLANES);
  for (const ClipPlane &plane : clip.planes) check_plane(plane, "a clipping plane");
}

ClipParams make_clip_params(const VolumeInfo &finest, const View &view, const Camera &camera,
                            const Clip &clip) {
  check_clip(clip);
  ClipParams params{};
  params.num_planes = static_cast<uint>(clip.planes.size());
  params.with_caps = clip.caps ? 1 : 0;
  params.t_scale = view.t_scale;
  const CameraAxes axes = axes_of(camera);
  const glm::dmat3 to_world = finest.index_to_world();
  const double scale = view.t_scale;
  for (std::size_t i = 0; i < clip.planes.size(); ++i) {
    const double length = glm::length(clip.planes[i].normal);
    const glm::dvec3 normal = clip.planes[i].normal / length;
    const double offset = clip.planes[i].offset / length;
    const glm::dvec3 growth = glm::transpose(to_world) * normal / scale;
    params.planes[i] = {.eye = limited((glm::dot(normal, camera.eye) - offset) / scale),
                        .fwd = static_cast<float>(glm::dot(normal, axes.forward)),
                        .right = static_cast<float>(glm::dot(normal, axes.right)),
                        .up = static_cast<float>(glm::dot(normal, axes.up)),
                        .grad_x = static_cast<float>(growth.x),
                        .grad_y = static_cast<float>(growth.y),
                        .grad_z = static_cast<float>(growth.z),
                        .first_voxel = limited((glm::dot(normal, finest.origin) - offset) / scale)};
  }
  return params;
}

}  // namespace isowave::core
