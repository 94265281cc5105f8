#include "core/frame/ambient_rays.hpp"

#include <cmath>
#include <numbers>

#include "core/base/error.hpp"
#include "core/frame/appearance.hpp"

namespace isowave::core {

void check_ambient_rays(std::uint32_t num_rays) {
  if (num_rays > ISO_MAX_AMBIENT_RAYS)
    throw Error("{} ambient rays of a hit are too many: up to {} can be cast", num_rays,
                ISO_MAX_AMBIENT_RAYS);
}

AmbientParams make_ambient_params(const VolumeInfo &info) {
  AmbientParams params{};
  const glm::dmat3 index_to_world = info.index_to_world(), to_index = glm::inverse(index_to_world);
  store_rows(glm::transpose(to_index), params.normal);
  store_rows(index_to_world, params.view);
  store_rows(to_index, params.to_index);
  return params;
}

std::vector<AmbientDirection> make_ambient_directions(std::uint32_t num_rays) {
  std::vector<AmbientDirection> directions;
  for (std::uint32_t k = 0; k < num_rays; ++k) {
    for (std::uint32_t pattern = 0; pattern < ISO_AMBIENT_PATTERNS; ++pattern) {
      const double step = (pattern + 0.5) / ISO_AMBIENT_PATTERNS;
      const double area = (k + step) / num_rays;  // of the unit disk, within this point's radius
      const double turn = k / std::numbers::phi + double(pattern) / ISO_AMBIENT_PATTERNS;
      const double angle = 2 * std::numbers::pi * turn, radius = std::sqrt(area);
      directions.push_back({static_cast<float>(radius * std::cos(angle)),
                            static_cast<float>(radius * std::sin(angle)),
                            static_cast<float>(std::sqrt(1 - area))});
    }
  }
  return directions;
}

}  // namespace isowave::core
