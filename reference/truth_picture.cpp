#include "reference/truth_picture.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/base/parallel_for.hpp"

namespace isowave::core {

namespace {

/// A camera's axes, and half the extents of its picture: at distance 1, or in parallel projection
/// in world units.
struct Eye {
  glm::dvec3 place, forward, right, up;
  double half_width = 0, half_height = 0;
  bool is_parallel = false;
};

Eye eye_of(const Camera &camera, ImageSize size) {
  Eye eye;
  eye.place = camera.eye;
  eye.forward = glm::normalize(camera.at - camera.eye);
  eye.right = glm::normalize(glm::cross(eye.forward, camera.up));
  eye.up = glm::cross(eye.right, eye.forward);
  eye.is_parallel = camera.parallel_height.has_value();
  eye.half_height =
      eye.is_parallel ? *camera.parallel_height / 2 : std::tan(glm::radians(camera.fovy_deg) / 2);
  eye.half_width = eye.half_height * size.width / size.height;
  return eye;
}

/// A ray in world space.
struct SightLine {
  glm::dvec3 origin, direction;
};

/// x, y  place in the picture, [0,1], from the upper left corner
SightLine ray_at(const Eye &eye, double x, double y) {
  const glm::dvec3 aside =
      (2 * x - 1) * eye.half_width * eye.right + (1 - 2 * y) * eye.half_height * eye.up;
  if (eye.is_parallel) return {eye.place + aside, eye.forward};
  return {eye.place, eye.forward + aside};
}

class TruthPainter {
 public:
  TruthPainter(const GridOracle &oracle, const VolumeInfo &info, const Camera &camera,
               ImageSize size, const Appearance &appearance)
      : oracle_(oracle),
        eye_(eye_of(camera, size)),
        origin_(info.origin),
        to_index_(glm::inverse(info.index_to_world())),
        appearance_(appearance) {}

  /// The display values of a ray.
  ///
  /// sky  place in [0,1)^2 of the direction in which the hit looks at the sky; none: all of it is
  ///      open
  /// behind  the background of the ray's pixel
  glm::dvec3 color_at(double x, double y, const std::optional<glm::dvec2> &sky,
                      const glm::dvec3 &behind) const {
    const SightLine world = ray_at(eye_, x, y);
    const glm::dvec3 origin = to_index_ * (world.origin - origin_),
                     direction = to_index_ * world.direction;
    const OracleHit hit = first_hit(origin, direction);
    if (!hit.hit) return behind;
    const glm::dvec3 place = origin + hit.t * direction;
    const auto [x_slope, y_slope, z_slope] =
        oracle_.voxels().smooth_gradient({place.x, place.y, place.z}, hit.cell);
    const glm::dvec3 gradient = glm::transpose(to_index_) * glm::dvec3(x_slope, y_slope, z_slope);
    const bool is_open = !sky || sees_sky(place, gradient, world.direction, *sky);
    return lit(gradient, world.direction, is_open ? 1 : 0);
  }

 private:
  OracleHit first_hit(const glm::dvec3 &origin, const glm::dvec3 &direction) const {
    return oracle_.first_hit(
        {{origin.x, origin.y, origin.z}, {direction.x, direction.y, direction.z}});
  }

  /// Whether a ray from half a voxel above a hit meets nothing. Directions are distributed by their
  /// cosine with the normal.
  bool sees_sky(const glm::dvec3 &place, const glm::dvec3 &gradient, const glm::dvec3 &direction,
                const glm::dvec2 &sky) const {
    glm::dvec3 normal = glm::length(gradient) > 0 ? glm::normalize(gradient) : -direction;
    if (glm::dot(normal, direction) > 0) normal = -normal;
    const glm::dvec3 other = std::abs(normal.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    const glm::dvec3 a = glm::normalize(glm::cross(normal, other)), b = glm::cross(normal, a);
    const double angle = 2 * std::numbers::pi * sky.x, radius = std::sqrt(sky.y);
    const glm::dvec3 towards =
        radius * (std::cos(angle) * a + std::sin(angle) * b) + std::sqrt(1 - sky.y) * normal;
    return !first_hit(place + 0.5 * glm::normalize(to_index_ * normal), to_index_ * towards).hit;
  }

  /// gradient, direction  of the field and of the ray, world space
  /// open                 share of the sky that the hit sees
  glm::dvec3 lit(const glm::dvec3 &gradient, const glm::dvec3 &direction, double open) const {
    const double length = glm::length(gradient);
    const glm::dvec3 normal = length > 0 ? gradient / length : glm::dvec3(0);
    const double facing = length > 0 ? -glm::dot(normal, glm::normalize(direction)) : 1;
    const double cosine = std::abs(facing);
    // The light above stands halfway between the viewer and up; near silhouettes, slopes fade.
    constexpr double kGrazing = 0.125;
    const double side = facing / std::max(cosine, kGrazing);
    const double slope =
        std::max(0.0, (glm::dot(normal, eye_.up) * side + cosine) / std::sqrt(2.0));
    const double light = double{appearance_.diffuse} * cosine +
                         open * (double{appearance_.ambient} + double{appearance_.above} * slope);
    const double highlight = double{appearance_.specular} * std::pow(cosine, 32);
    return glm::clamp(glm::dvec3(appearance_.surface) * light + highlight, 0.0, 1.0);
  }

  const GridOracle &oracle_;
  Eye eye_;
  glm::dvec3 origin_;
  glm::dmat3 to_index_;
  Appearance appearance_;
};

/// y  place in the picture, [0,1], from the upper edge
glm::dvec3 background_of(const Appearance &appearance, double y) {
  const glm::dvec3 bottom(appearance.background);
  return glm::mix(bottom, glm::dvec3(appearance.background_top.value_or(bottom)), 1 - y);
}

/// Places in [0,1)^2 that the rays of a pixel, and those of its neighbours, spread evenly: a
/// sequence by the plastic number, begun anew at each pixel.
glm::dvec2 spread(std::size_t pixel, std::uint32_t ray) {
  constexpr double kX = 0.7548776662466927, kY = 0.5698402909980532;
  const double n = ray, begin = double(pixel % 65521);
  const auto part = [](double x) { return x - std::floor(x); };
  return {part(begin * kY + n * kX), part(begin * kX + n * kY)};
}

}  // namespace

Image8 truth_picture(const GridOracle &oracle, const VolumeInfo &info, const Camera &camera,
                     ImageSize size, Sky sky, const Appearance &appearance) {
  const TruthPainter painter(oracle, info, camera, size, appearance);
  Image8 image{size.width, size.height, 3,
               std::vector<std::uint8_t>(std::size_t{3} * size.num_pixels())};
  const double columns = size.ray_columns(), rows = size.ray_rows();
  parallel_for(size.height, 0, [&](std::uint64_t row, std::uint32_t) {
    for (std::uint32_t column = 0; column < size.width; ++column) {
      const std::size_t pixel = row * size.width + column;
      const glm::dvec3 behind = background_of(appearance, (double(row) + 0.5) / size.height);
      glm::dvec3 sum(0);
      for (std::uint32_t ray = 0; ray < size.samples * size.samples; ++ray) {
        const std::uint32_t x = ray % size.samples, y = ray / size.samples;
        sum += painter.color_at(
            (double(size.samples) * column + x + 0.5) / columns,
            (double(size.samples) * double(row) + y + 0.5) / rows,
            sky == Sky::kSeen ? std::optional(spread(pixel, ray)) : std::nullopt, behind);
      }
      const glm::dvec3 mean = sum / (double(size.samples) * size.samples);
      for (int channel = 0; channel < 3; ++channel)
        image.pixels[3 * pixel + static_cast<std::size_t>(channel)] =
            static_cast<std::uint8_t>(std::lround(255 * mean[channel]));
    }
  });
  return image;
}

}  // namespace isowave::core
