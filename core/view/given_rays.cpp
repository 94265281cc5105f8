#include "core/view/given_rays.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

double largest(const glm::dvec3 &v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// number: of the ray, for messages.
IndexRay index_ray(const glm::dvec3 &origin, const glm::dvec3 &direction, std::size_t number) {
  const double length = largest(direction), away = largest(origin);
  if (!std::isfinite(length + direction.x + direction.y + direction.z) || length == 0)
    throw Error("ray {} has no direction: give three finite numbers that are not all 0", number);
  if (!std::isfinite(away + origin.x + origin.y + origin.z) || away > 1e7) {
    throw Error("ray {} begins {:.3g} voxels from the volume's origin: up to 1e7 can be traced",
                number, away);
  }
  int exponent = 0;
  std::frexp(length, &exponent);
  const glm::vec3 o(origin), d(direction * std::exp2(-exponent));
  return {{o.x, o.y, o.z, d.x, d.y, d.z, 0}, static_cast<float>(std::exp2(-exponent))};
}

}  // namespace

std::vector<IndexRay> make_index_rays(const VolumeInfo &info, std::span<const WorldRay> rays) {
  const glm::dmat3 world_to_index = glm::inverse(info.index_to_world());
  std::vector<IndexRay> index_rays(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    index_rays[i] = index_ray(world_to_index * (rays[i].origin - info.origin),
                              world_to_index * rays[i].direction, i);
  }
  return index_rays;
}

}  // namespace isowave::core
