#include "core/frame/ambient_rays.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/error.hpp"
#include "core/frame/appearance.hpp"
#include "core/view/trigonometry.hpp"

namespace isowave::core {

void check_ambient_rays(std::uint32_t num_rays) {
  if (num_rays > ISO_MAX_AMBIENT_RAYS)
    throw Error("{} ambient rays of a hit are too many: up to {} can be cast", num_rays,
                ISO_MAX_AMBIENT_RAYS);
}

void check_shadow_rays(const FrameRequest &request) {
  if (request.shadow_rays > ISO_MAX_AMBIENT_RAYS)
    throw Error("{} shadow rays of a hit are too many: up to {} can be cast", request.shadow_rays,
                ISO_MAX_AMBIENT_RAYS);
  if (request.bounce_rays > ISO_MAX_AMBIENT_RAYS)
    throw Error("{} bounce rays of a hit are too many: up to {} can be cast", request.bounce_rays,
                ISO_MAX_AMBIENT_RAYS);
  if (!(request.light_angle > 0 && request.light_angle <= 45))
    throw Error("a light angle of {} degrees is out of range: give more than 0, at most 45",
                request.light_angle);
  if (request.shadow_rays != 0 && !request.light.towards_light)
    throw Error("shadows need a light of the scene: give its direction");
  if (request.bounce_rays != 0 && !request.light.towards_light)
    throw Error("bounced light needs a light of the scene: give its direction");
}

LightRays light_rays_of(const FrameRequest &request) {
  LightRays rays{.num_ambient = std::max(request.ambient_rays, request.bounce_rays),
                 .num_shadow = request.shadow_rays,
                 .bounces = request.bounce_rays != 0};
  if (rays.num_shadow == 0 && !rays.bounces) return rays;
  check_shadow_rays(request);
  rays.light = glm::normalize(request.light.towards_light.value());
  rays.angle = request.light_angle;
  return rays;
}

OpenCounts no_counts(const LightRays &rays, std::size_t num_hits) {
  return {std::vector<uchar>((rays.num_shadow != 0 ? 2 : 1) * num_hits)};
}

AmbientParams make_ambient_params(const VolumeInfo &info, std::uint32_t num_ambient) {
  AmbientParams params{};
  params.num_ambient = num_ambient;
  const glm::dmat3 index_to_world = info.index_to_world(), to_index = glm::inverse(index_to_world);
  store_rows(glm::transpose(to_index), params.normal);
  store_rows(index_to_world, params.view);
  store_rows(to_index, params.to_index);
  return params;
}

namespace {

/// A point of the spiral, of the unit disk.
struct SpiralPoint {
  double area;   ///< of the disk within the point's radius, as a share
  double angle;  ///< [radians]
};

/// Calls add(point) for each ray and pattern.
template <class Add>
void for_spiral(std::uint32_t num_rays, const Add &add) {
  for (std::uint32_t k = 0; k < num_rays; ++k) {
    for (std::uint32_t pattern = 0; pattern < ISO_AMBIENT_PATTERNS; ++pattern) {
      const double step = (pattern + 0.5) / ISO_AMBIENT_PATTERNS;
      const double turn = k / std::numbers::phi + double(pattern) / ISO_AMBIENT_PATTERNS;
      add(SpiralPoint{(k + step) / num_rays, 2 * std::numbers::pi * turn});
    }
  }
}

AmbientDirection direction_of(const glm::dvec3 &v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

}  // namespace

std::vector<AmbientDirection> make_ambient_directions(std::uint32_t num_rays) {
  std::vector<AmbientDirection> directions;
  for_spiral(num_rays, [&](const SpiralPoint &point) {
    const double radius = std::sqrt(point.area);
    directions.push_back(
        direction_of({radius * core::cosine(point.angle), radius * core::sine(point.angle),
                      std::sqrt(1 - point.area)}));
  });
  return directions;
}

std::vector<AmbientDirection> make_light_directions(const LightRays &rays) {
  std::vector<AmbientDirection> directions = make_ambient_directions(rays.num_ambient);
  const glm::dvec3 &light = rays.light;
  const glm::dvec3 other = std::abs(light.z) < 0.5 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(light, other)), v = glm::cross(light, u);
  const std::uint32_t rows = rays.num_shadow == 0 && rays.bounces ? 1 : rays.num_shadow;
  const double height = rows == 1 ? 0 : 1 - core::cosine(glm::radians(rays.angle));
  for_spiral(rows, [&](const SpiralPoint &point) {
    const double cosine = 1 - point.area * height, sine = std::sqrt(1 - cosine * cosine);
    directions.push_back(direction_of(cosine * light + sine * core::cosine(point.angle) * u +
                                      sine * core::sine(point.angle) * v));
  });
  return directions;
}

}  // namespace isowave::core
