#include "reference/truth_picture.hpp"

#include <algorithm>
#include <cmath>

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
  glm::dvec3 color_at(double x, double y) const {
    const SightLine world = ray_at(eye_, x, y);
    const glm::dvec3 origin = to_index_ * (world.origin - origin_),
                     direction = to_index_ * world.direction;
    const OracleHit hit = oracle_.first_hit(
        {{origin.x, origin.y, origin.z}, {direction.x, direction.y, direction.z}});
    if (!hit.hit) return appearance_.background;
    const glm::dvec3 place = origin + hit.t * direction;
    const auto gradient = oracle_.voxels().smooth_gradient({place.x, place.y, place.z}, hit.cell);
    return lit(glm::transpose(to_index_) * glm::dvec3(gradient[0], gradient[1], gradient[2]),
               world.direction);
  }

 private:
  /// gradient, direction  of the field and of the ray, world space
  glm::dvec3 lit(const glm::dvec3 &gradient, const glm::dvec3 &direction) const {
    const double length = glm::length(gradient);
    const glm::dvec3 normal = length > 0 ? gradient / length : glm::dvec3(0);
    const double facing = length > 0 ? -glm::dot(normal, glm::normalize(direction)) : 1;
    const double cosine = std::abs(facing);
    // The light above stands halfway between the viewer and up; near silhouettes, slopes fade.
    constexpr double kGrazing = 0.125;
    const double side = facing / std::max(cosine, kGrazing);
    const double slope =
        std::max(0.0, (glm::dot(normal, eye_.up) * side + cosine) / std::sqrt(2.0));
    const double light = double{appearance_.ambient} + double{appearance_.diffuse} * cosine +
                         double{appearance_.above} * slope;
    const double highlight = double{appearance_.specular} * std::pow(cosine, 32);
    return glm::clamp(glm::dvec3(appearance_.surface) * light + highlight, 0.0, 1.0);
  }

  const GridOracle &oracle_;
  Eye eye_;
  glm::dvec3 origin_;
  glm::dmat3 to_index_;
  Appearance appearance_;
};

}  // namespace

Image8 truth_picture(const GridOracle &oracle, const VolumeInfo &info, const Camera &camera,
                     ImageSize size, const Appearance &appearance) {
  const TruthPainter painter(oracle, info, camera, size, appearance);
  Image8 image{size.width, size.height, 3,
               std::vector<std::uint8_t>(std::size_t{3} * size.num_pixels())};
  const double columns = size.ray_columns(), rows = size.ray_rows();
  parallel_for(size.height, 0, [&](std::uint64_t row, std::uint32_t) {
    for (std::uint32_t column = 0; column < size.width; ++column) {
      glm::dvec3 sum(0);
      for (std::uint32_t y = 0; y < size.samples; ++y) {
        for (std::uint32_t x = 0; x < size.samples; ++x) {
          sum += painter.color_at((double(size.samples) * column + x + 0.5) / columns,
                                  (double(size.samples) * double(row) + y + 0.5) / rows);
        }
      }
      const glm::dvec3 mean = sum / (double(size.samples) * size.samples);
      const std::size_t pixel = row * size.width + column;
      for (int channel = 0; channel < 3; ++channel)
        image.pixels[3 * pixel + static_cast<std::size_t>(channel)] =
            static_cast<std::uint8_t>(255 * mean[channel] + 0.5);
    }
  });
  return image;
}

}  // namespace isowave::core
