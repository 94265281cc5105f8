#include "core/view/camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/json_file.hpp"
#include "core/view/trigonometry.hpp"

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

namespace {

/// axis  of length 1
glm::dquat turn_about(double angle, const glm::dvec3 &axis) {
  return {cosine(angle / 2), sine(angle / 2) * axis};
}

}  // namespace

Camera turned(const Camera &camera, double degrees, const std::optional<glm::dvec3> &axis) {
  const glm::dvec3 about = axis.value_or(camera.up);
  const glm::dquat turn = turn_about(glm::radians(degrees), glm::normalize(about));
  Camera result = camera;
  result.eye = camera.at + turn * (camera.eye - camera.at);
  if (about != camera.up) result.up = turn * camera.up;
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
  const glm::dquat turn =
      turn_about(by * pixel_size_at(camera, height, 1), glm::normalize(glm::cross(forward, to)));
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
  result.parallel_height = 2 * distance * tangent(glm::radians(camera.fovy_deg) / 2);
  return result;
}

double pixel_size_at(const Camera &camera, std::uint32_t height, double distance) {
  if (camera.parallel_height) return *camera.parallel_height / height;
  return distance * (2.0 * tangent(glm::radians(camera.fovy_deg) / 2) / height);
}

namespace {

CameraFile camera_file_of(const json &root, const std::string &where) {
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

}  // namespace

CameraFile read_camera_file(const std::filesystem::path &path) {
  return camera_file_of(read_json(path, "camera file", kMostBytes), path.string());
}

CameraFile parse_camera_file(std::string_view text, const std::string &where) {
  return camera_file_of(parse_json(text, where, "camera file"), where);
}

std::string camera_file_text(const std::vector<Camera> &cameras, std::uint32_t width,
                             std::uint32_t height) {
  using nlohmann::ordered_json;
  const auto list = [](const glm::dvec3 &v) { return ordered_json{v.x, v.y, v.z}; };
  ordered_json entries = ordered_json::array();
  for (const Camera &camera : cameras) {
    if (camera.fovy_deg != cameras.front().fovy_deg)
      throw Error("a camera file has one fovy_deg for all cameras, and these have {} and {}",
                  cameras.front().fovy_deg, camera.fovy_deg);
    ordered_json entry = {
        {"eye", list(camera.eye)}, {"at", list(camera.at)}, {"up", list(camera.up)}};
    if (camera.parallel_height) entry["parallel_height"] = *camera.parallel_height;
    entries.push_back(entry);
  }
  const ordered_json file = {{"width", width},
                             {"height", height},
                             {"fovy_deg", cameras.at(0).fovy_deg},
                             {"cameras", entries}};
  return file.dump() + "\n";
}

Orientation orientation_of(const VolumeInfo &info, const std::optional<glm::dvec3> &up) {
  // A patient's world is LPS: +x left, +y posterior, +z superior.
  Orientation result = info.is_anatomical ? Orientation{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}
                                          : Orientation{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  if (!up) return result;
  const double length = glm::length(*up);
  if (!(length > 1 / kLongest && length < kLongest))
    throw Error("up is {} {} {}: give a direction", up->x, up->y, up->z);
  const glm::dvec3 to = *up / length;
  const double cosine = glm::dot(result.up, to);
  if (cosine < -1 + 1e-12) {  // upside down: what is in front stays there
    result.right = -result.right;
  } else {
    const glm::dvec3 axis = glm::cross(result.up, to);  // as long as the angle's sine
    const auto turn = [&](const glm::dvec3 &v) {
      return cosine * v + glm::cross(axis, v) + axis * (glm::dot(axis, v) / (1 + cosine)) + 0.0;
    };
    result.right = turn(result.right);
    result.front = turn(result.front);
  }
  result.up = to;
  return result;
}

namespace {

constexpr double kElevation = 20.0 * std::numbers::pi / 180.0, kFirstAzimuth = 0.3;
constexpr double kFovyDeg = 60.0;

double azimuth_of(std::uint32_t view, std::uint32_t num_views) {
  return 2.0 * std::numbers::pi * view / num_views + kFirstAzimuth;
}

/// From the point looked at, of length 1.
glm::dvec3 towards_eye(const Orientation &to, double azimuth) {
  return cosine(kElevation) * sine(azimuth) * to.right + sine(kElevation) * to.up +
         cosine(kElevation) * cosine(azimuth) * to.front;
}

/// A view from a side: its `up`, and from the point looked at towards the eye, of length 1.
struct ViewDirection {
  glm::dvec3 back, up;
};

ViewDirection view_direction(const VolumeInfo &info, const Orientation &to, Side side) {
  // The patient's own right is at the left of one who is looked at from the front.
  const glm::dvec3 own_right = info.is_anatomical ? -to.right : to.right;
  switch (side) {
    case Side::kFront:
      return {to.front, to.up};
    case Side::kBack:
      return {-to.front, to.up};
    case Side::kLeft:
      return {-own_right, to.up};
    case Side::kRight:
      return {own_right, to.up};
    case Side::kTop:
      return {to.up, -to.front};
    case Side::kBottom:
      return {-to.up, to.front};
    case Side::kIso:
      return {glm::normalize(to.right + to.up + to.front), to.up};
    case Side::kCorner:
      break;
  }
  return {towards_eye(to, kFirstAzimuth), to.up};
}

glm::dvec3 turned_about(const glm::dvec3 &axis, const glm::dvec3 &v, double angle) {
  const glm::dvec3 along = axis * glm::dot(axis, v);
  return along + cosine(angle) * (v - along) + sine(angle) * glm::cross(axis, v);
}

/// World vectors from a box's centre to its corners.
std::array<glm::dvec3, 8> corners_of(const VolumeInfo &info, const glm::dvec3 &size) {
  std::array<glm::dvec3, 8> corners{};
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const glm::dvec3 half(corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5,
                          corner & 4 ? 0.5 : -0.5);
    corners[corner] = info.index_to_world() * (half * size);
  }
  return corners;
}

/// Distance from which each corner is within kMargin of the picture, or its mirror image on the
/// other side.
///
/// tan_v  of half the vertical angle
double distance_to_fit(const std::array<glm::dvec3, 8> &corners, const ViewDirection &from,
                       double tan_v, double aspect) {
  const double v = kMargin * tan_v, u = aspect * v;
  const glm::dvec3 right = glm::normalize(glm::cross(from.up, from.back)),
                   above = glm::cross(from.back, right);
  double distance = 0;
  for (const glm::dvec3 &at : corners) {
    const double nearer = glm::dot(at, from.back);
    distance = std::max({distance, nearer + std::abs(glm::dot(at, right)) / u,
                         nearer + std::abs(glm::dot(at, above)) / v});
  }
  return distance;
}

}  // namespace

Camera camera_of_box(const VolumeInfo &info, const glm::dvec3 &begin, const glm::dvec3 &end,
                     double aspect, const Viewpoint &from) {
  const Orientation orientation = orientation_of(info, from.up);
  const ViewDirection first = view_direction(info, orientation, from.side);
  const glm::dvec3 centre = info.origin + info.index_to_world() * (0.5 * (begin + end));
  const std::array<glm::dvec3, 8> corners = corners_of(info, end - begin);
  const double tan_v = tangent(glm::radians(kFovyDeg) / 2);
  double distance = 0;
  for (std::uint32_t view = 0; view < from.num_views; ++view) {
    const double angle = 2.0 * std::numbers::pi * view / from.num_views;
    const ViewDirection turned{turned_about(orientation.up, first.back, angle),
                               turned_about(orientation.up, first.up, angle)};
    distance =
        std::max(distance, distance_to_fit(corners, view == 0 ? first : turned, tan_v, aspect));
  }
  return zoomed({centre + distance * first.back, centre, first.up, kFovyDeg}, from.zoom);
}

Camera fitted(const Camera &camera, const VolumeInfo &info, double aspect) {
  check_camera(camera, "the camera");
  const glm::dvec3 size(info.dims - 1u);
  const CameraAxes axes = axes_of(camera);
  const std::array<glm::dvec3, 8> corners = corners_of(info, size);
  Camera result = camera;
  result.at = info.origin + info.index_to_world() * (0.5 * size);
  double distance = distance_to_fit(corners, {-axes.forward, axes.up},
                                    tangent(glm::radians(camera.fovy_deg) / 2), aspect);
  if (camera.parallel_height) {
    double half = 0, depth = 0;
    for (const glm::dvec3 &at : corners) {
      half = std::max(
          {half, std::abs(glm::dot(at, axes.up)), std::abs(glm::dot(at, axes.right)) / aspect});
      depth = std::max(depth, glm::length(at));
    }
    result.parallel_height = 2 * half / kMargin;
    distance = 2 * depth;  // the eye's plane is in front of the box
  }
  result.eye = result.at - distance * axes.forward;
  return result;
}

Camera zoomed(const Camera &camera, double zoom) {
  if (!(zoom >= 0.01 && zoom <= 1000)) throw Error("a zoom of {}: give 0.01 to 1000", zoom);
  Camera result = camera;
  if (zoom == 1) return result;
  result.fovy_deg =
      glm::degrees(2 * arc_tangent(tangent(glm::radians(camera.fovy_deg) / 2) / zoom));
  if (camera.parallel_height) result.parallel_height = *camera.parallel_height / zoom;
  return result;
}

std::vector<Camera> turntable(const Camera &first, std::uint32_t n,
                              const std::optional<glm::dvec3> &axis) {
  std::vector<Camera> cameras{first};
  for (std::uint32_t k = 1; k < n; ++k) cameras.push_back(turned(first, 360.0 * k / n, axis));
  return cameras;
}

std::vector<Camera> orbit_cameras(const VolumeInfo &info, std::uint32_t n,
                                  const std::optional<glm::dvec3> &up, double aspect) {
  const glm::dmat3 index_to_world = info.index_to_world();
  const Orientation to = orientation_of(info, up);
  const glm::dvec3 extent(info.dims - 1u);
  const glm::dvec3 centre = info.origin + index_to_world * (0.5 * extent);
  // A sheared box has four different diagonals: the one from the first to the last voxel counts.
  const double distance = 0.8 * glm::length(index_to_world * extent) * std::max(1.0, 1.0 / aspect);

  std::vector<Camera> cameras;
  cameras.reserve(n);
  for (std::uint32_t k = 0; k < n; ++k) {
    cameras.push_back(
        {centre + distance * towards_eye(to, azimuth_of(k, n)), centre, to.up, kFovyDeg});
  }
  return cameras;
}

}  // namespace isowave::core
