#include "core/view/camera.hpp"

#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/json_file.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;

/// sin of the smallest angle between view and up: below it the image's right is rounding noise.
constexpr double kMinSinViewUp = 1e-6;
/// Greatest length of eye to at, and of up. Squares of longer vectors, and of vectors as much
/// shorter than 1, leave double's range.
constexpr double kLongest = 0x1p500;
/// Largest camera file [bytes]: 30,000 cameras.
constexpr std::uint64_t kMostBytes = 4u << 20;

const json &member(const json &object, const char *key, const std::string &where) {
  if (!object.is_object()) throw Error("{}: expected an object with \"{}\"", where, key);
  const auto found = object.find(key);
  if (found == object.end()) throw Error("{}: \"{}\" is missing", where, key);
  return *found;
}

double number(const json &value, const char *key, const std::string &where) {
  if (!value.is_number()) throw Error("{}: \"{}\" must be a number", where, key);
  return value.get<double>();
}

std::uint32_t positive_uint(const json &value, const char *key, const std::string &where) {
  const bool fits = value.is_number_unsigned() && value.get<std::uint64_t>() >= 1 &&
                    value.get<std::uint64_t>() <= std::numeric_limits<std::uint32_t>::max();
  if (!fits) throw Error("{}: \"{}\" must hold whole numbers of at least 1", where, key);
  return value.get<std::uint32_t>();
}

const json &triple(const json &value, const char *key, const std::string &where) {
  if (!value.is_array() || value.size() != 3)
    throw Error("{}: \"{}\" must be [x, y, z]", where, key);
  return value;
}

glm::dvec3 vector3(const json &value, const char *key, const std::string &where) {
  const json &v = triple(value, key, where);
  return {number(v[0], key, where), number(v[1], key, where), number(v[2], key, where)};
}

glm::uvec3 size3(const json &value, const char *key, const std::string &where) {
  const json &v = triple(value, key, where);
  return {positive_uint(v[0], key, where), positive_uint(v[1], key, where),
          positive_uint(v[2], key, where)};
}

bool finite(const glm::dvec3 &v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// The vector `pixels`, to the right and up in the picture, in world axes [pixels].
glm::dvec3 in_picture(const Camera &camera, const glm::dvec2 &pixels) {
  const CameraAxes axes = axes_of(camera);
  return pixels.x * axes.right + pixels.y * axes.up;
}

}  // namespace

CameraAxes axes_of(const Camera &camera) {
  const glm::dvec3 forward = glm::normalize(camera.at - camera.eye),
                   right = glm::normalize(glm::cross(forward, camera.up));
  return {forward, right, glm::cross(right, forward)};
}

void check_camera(const Camera &camera, std::string_view what) {
  if (!finite(camera.eye) || !finite(camera.at) || !finite(camera.up)) {
    throw Error("{}: eye, at and up must be finite", what);
  }
  if (!(camera.fovy_deg > 0.0 && camera.fovy_deg < 180.0)) {
    throw Error("{}: fovy_deg is {}, must be between 0 and 180", what, camera.fovy_deg);
  }
  if (const double height = camera.parallel_height.value_or(1);
      !(height > 1 / kLongest && height < kLongest))
    throw Error("{}: the height of parallel projection is {}, must be above 0", what, height);
  const glm::dvec3 view = camera.at - camera.eye;
  const double view_length = glm::length(view), up_length = glm::length(camera.up);
  if (view_length > kLongest || up_length > kLongest)
    throw Error("{}: eye, at and up are too large", what);
  if (view_length < 1 / kLongest) throw Error("{}: eye and at are the same point", what);
  if (up_length < 1 / kLongest) throw Error("{}: up is the zero vector", what);
  if (glm::length(glm::cross(view / view_length, camera.up / up_length)) < kMinSinViewUp) {
    throw Error("{}: up is parallel to the view; choose another up", what);
  }
}

Camera turned(const Camera &camera, double degrees) {
  const glm::dquat turn = glm::angleAxis(glm::radians(degrees), glm::normalize(camera.up));
  Camera result = camera;
  result.eye = camera.at + turn * (camera.eye - camera.at);
  return result;
}

Camera aside(const Camera &camera, const glm::dvec2 &pixels, std::uint32_t height) {
  const glm::dvec3 forward = camera.at - camera.eye, to = in_picture(camera, pixels);
  const double by = glm::length(to);
  Camera result = camera;
  if (by == 0) return result;
  if (camera.parallel_height) {
    const glm::dvec3 step = to * pixel_size_at(camera, height, 1);
    result.eye += step;
    result.at += step;
    return result;
  }
  const glm::dquat turn = glm::angleAxis(by * pixel_size_at(camera, height, 1),
                                         glm::normalize(glm::cross(forward, to)));
  result.at = camera.eye + turn * forward;
  result.up = turn * camera.up;
  return result;
}

glm::dvec3 point_of_ray(const Camera &camera, const glm::dvec2 &pixels, std::uint32_t height,
                        double distance) {
  const glm::dvec3 forward = glm::normalize(camera.at - camera.eye),
                   beside = in_picture(camera, pixels) * pixel_size_at(camera, height, 1);
  if (camera.parallel_height) return camera.eye + beside + distance * forward;
  return camera.eye + distance * glm::normalize(forward + beside);
}

Camera in_parallel(const Camera &camera) {
  Camera result = camera;
  const double distance = glm::length(camera.at - camera.eye);
  result.parallel_height = 2 * distance * std::tan(glm::radians(camera.fovy_deg) / 2);
  return result;
}

double pixel_size_at(const Camera &camera, std::uint32_t height, double distance) {
  if (camera.parallel_height) return *camera.parallel_height / height;
  return distance * (2.0 * std::tan(glm::radians(camera.fovy_deg) / 2) / height);
}

CameraFile read_camera_file(const std::filesystem::path &path) {
  const std::string where = path.string();
  const json root = read_json(path, "camera file", kMostBytes);

  CameraFile file;
  const double fovy_deg = number(member(root, "fovy_deg", where), "fovy_deg", where);
  if (root.contains("dims")) file.dims = size3(root["dims"], "dims", where);
  if (root.contains("spacing")) {
    file.spacing = vector3(root["spacing"], "spacing", where);
    if (!finite(*file.spacing) || !glm::all(glm::greaterThan(*file.spacing, glm::dvec3(0.0)))) {
      throw Error("{}: \"spacing\" must be finite and positive", where);
    }
  }
  if (root.contains("width")) file.width = positive_uint(root["width"], "width", where);
  if (root.contains("height")) file.height = positive_uint(root["height"], "height", where);

  const json &cameras = member(root, "cameras", where);
  if (!cameras.is_array() || cameras.empty()) {
    throw Error("{}: \"cameras\" must be a list of at least one camera", where);
  }
  for (const json &entry : cameras) {
    const std::string what = fmt::format("{}: camera {}", where, file.cameras.size());
    Camera camera{vector3(member(entry, "eye", what), "eye", what),
                  vector3(member(entry, "at", what), "at", what),
                  vector3(member(entry, "up", what), "up", what), fovy_deg};
    if (entry.contains("parallel_height"))
      camera.parallel_height = number(entry["parallel_height"], "parallel_height", what);
    check_camera(camera, what);
    file.cameras.push_back(camera);
  }
  return file;
}

namespace {

constexpr double kElevation = 20.0 * std::numbers::pi / 180.0, kFirstAzimuth = 0.3;
constexpr double kFovyDeg = 60.0;

double azimuth_of(std::uint32_t view, std::uint32_t num_views) {
  return 2.0 * std::numbers::pi * view / num_views + kFirstAzimuth;
}

/// From the point looked at, of length 1.
glm::dvec3 towards_eye(double azimuth) {
  return {std::cos(kElevation) * std::sin(azimuth), std::sin(kElevation),
          std::cos(kElevation) * std::cos(azimuth)};
}

}  // namespace

Camera camera_of_box(const VolumeInfo &info, const glm::dvec3 &begin, const glm::dvec3 &end,
                     double aspect, std::uint32_t num_views, double margin) {
  const glm::dmat3 to_world = info.index_to_world();
  const glm::dvec3 up(0.0, 1.0, 0.0);
  const glm::dvec3 centre = info.origin + to_world * (0.5 * (begin + end));
  const double tan_v = margin * std::tan(glm::radians(kFovyDeg) / 2), tan_u = aspect * tan_v;
  // From so far that each corner is within the picture, or its mirror image on the other side.
  double distance = 0;
  for (std::uint32_t view = 0; view < num_views; ++view) {
    const glm::dvec3 back = towards_eye(azimuth_of(view, num_views));
    const glm::dvec3 right = glm::normalize(glm::cross(up, back)), above = glm::cross(back, right);
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 half(corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5,
                            corner & 4 ? 0.5 : -0.5);
      const glm::dvec3 at = to_world * (half * (end - begin));
      const double nearer = glm::dot(at, back);
      distance = std::max({distance, nearer + std::abs(glm::dot(at, right)) / tan_u,
                           nearer + std::abs(glm::dot(at, above)) / tan_v});
    }
  }
  return {centre + distance * towards_eye(kFirstAzimuth), centre, up, kFovyDeg};
}

std::vector<Camera> turntable(const Camera &first, std::uint32_t n) {
  std::vector<Camera> cameras{first};
  for (std::uint32_t k = 1; k < n; ++k) cameras.push_back(turned(first, 360.0 * k / n));
  return cameras;
}

std::vector<Camera> orbit_cameras(const VolumeInfo &info, std::uint32_t n) {
  const glm::dmat3 index_to_world = info.index_to_world();
  const glm::dvec3 extent(info.dims - 1u);
  const glm::dvec3 centre = info.origin + index_to_world * (0.5 * extent);
  // A sheared box has four different diagonals: the one from the first to the last voxel counts.
  const double distance = 0.8 * glm::length(index_to_world * extent);

  std::vector<Camera> cameras;
  cameras.reserve(n);
  for (std::uint32_t k = 0; k < n; ++k) {
    cameras.push_back(
        {centre + distance * towards_eye(azimuth_of(k, n)), centre, {0.0, 1.0, 0.0}, kFovyDeg});
  }
  return cameras;
}

}  // namespace isowave::core
