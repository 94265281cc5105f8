#include "core/frame/surface_camera.hpp"

namespace isowave::core {

Camera surface_camera(const VolumeInfo &info, const std::optional<BlockBox> &box, ImageSize size,
                      const Viewpoint &from) {
  const glm::dvec3 last(info.dims - 1u);
  const glm::dvec3 begin = box ? 4.0 * glm::dvec3(box->begin) : glm::dvec3(0);
  const glm::dvec3 end = box ? glm::min(4.0 * glm::dvec3(box->end), last) : last;
  return camera_of_box(info, begin, end, double(size.width) / size.height, from);
}

}  // namespace isowave::core
