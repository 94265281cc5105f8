#include "reference/ray_rounding.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace isowave {

std::vector<double> ray_rounding(const VolumeInfo &info, const Camera &camera, ImageSize size,
                                 std::span<const HitRecord> hits) {
  if (hits.size() != size.num_pixels())
    throw std::invalid_argument("ray_rounding: the hits do not fit the image");
  const glm::dmat3 to_index = glm::inverse(info.index_to_world());
  const glm::dvec3 eye = to_index * (camera.eye - info.origin);
  const glm::dvec3 fwd = glm::normalize(camera.at - camera.eye);
  const glm::dvec3 right = glm::normalize(glm::cross(fwd, camera.up)), up = glm::cross(right, fwd);
  const double a = std::tan(camera.fovy_deg * std::numbers::pi / 360);
  const glm::uvec3 blocks = (info.dims + 3u) / 4u;
  std::vector<double> distances;
  for (std::size_t pixel = 0; pixel < hits.size(); ++pixel) {
    const HitRecord &hit = hits[pixel];
    if (!std::isfinite(hit.t)) continue;
    const std::size_t column = pixel % size.width, row = pixel / size.width;
    const double u = (2 * (double(column) + 0.5) / size.width - 1) * a * size.width / size.height;
    const double v = (1 - 2 * (double(row) + 0.5) / size.height) * a;
    const glm::dvec3 direction = glm::normalize(to_index * (fwd + u * right + v * up));
    const glm::uvec3 block(hit.block_id % blocks.x, hit.block_id / blocks.x % blocks.y,
                           hit.block_id / blocks.x / blocks.y);
    const glm::uvec3 cell = 4u * block + glm::uvec3(hit.cell & 3u, hit.cell >> 2 & 3u, hit.cell >> 4);
    const glm::dvec3 point = glm::dvec3(cell) + glm::dvec3(hit.x, hit.y, hit.z);
    distances.push_back(glm::length(glm::cross(point - eye, direction)));
  }
  return distances;
}

}  // namespace isowave
