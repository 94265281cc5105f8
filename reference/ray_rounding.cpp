#include "reference/ray_rounding.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "reference/accuracy.hpp"

namespace isowave::core {

std::vector<double> ray_rounding(const VolumeInfo &info, const Camera &camera, ImageSize size,
                                 std::span<const HitRecord> hits) {
  if (hits.size() != size.num_pixels())
    throw std::invalid_argument("ray_rounding: the hits do not fit the image");
  const glm::dmat3 to_index = glm::inverse(info.index_to_world());
  const glm::dvec3 eye = to_index * (camera.eye - info.origin);
  const glm::dvec3 fwd = glm::normalize(camera.at - camera.eye);
  const glm::dvec3 right = glm::normalize(glm::cross(fwd, camera.up)), up = glm::cross(right, fwd);
  const bool is_parallel = camera.parallel_height.has_value();
  const double a = is_parallel ? *camera.parallel_height / 2
                               : std::tan(camera.fovy_deg * std::numbers::pi / 360);
  const FrameParams frame = make_frame_params(info, camera, size, 0);
  std::vector<double> distances;
  for (std::size_t pixel = 0; pixel < hits.size(); ++pixel) {
    const HitRecord &hit = hits[pixel];
    if (!std::isfinite(hit.t)) continue;
    const std::size_t column = pixel % size.width, row = pixel / size.width;
    const double u = (2 * (double(column) + 0.5) / size.width - 1) * a * size.width / size.height;
    const double v = (1 - 2 * (double(row) + 0.5) / size.height) * a;
    const glm::dvec3 beside = u * right + v * up;
    const glm::dvec3 direction = glm::normalize(to_index * (is_parallel ? fwd : fwd + beside));
    const glm::dvec3 start = is_parallel ? eye + to_index * beside : eye;
    const auto [x, y, z] =
        renderer_hit(frame, exact_ray(make_ray(&frame, static_cast<std::uint32_t>(pixel))), hit)
            .point;
    const glm::dvec3 point(x, y, z);
    distances.push_back(glm::length(glm::cross(point - start, direction)));
  }
  return distances;
}

}  // namespace isowave::core
