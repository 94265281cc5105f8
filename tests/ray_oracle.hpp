#pragma once
// Rays in double precision and where fields with closed-form roots cross an isovalue along them.
// Shares nothing with the renderer but the camera's definition: what the twin and the kernels have
// in common is judged here.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/glm.hpp>
#include <limits>
#include <vector>

#include "core/view/camera.hpp"
#include "core/view/frame.hpp"

namespace isowave::core::test {

/// World space; t is the distance from the eye.
struct OracleRay {
  glm::dvec3 eye, direction;
};

/// The ray of pixel (column, row), row 0 at the top.
inline OracleRay oracle_ray(const Camera &camera, ImageSize size, std::uint32_t column,
                            std::uint32_t row) {
  const glm::dvec3 fwd = glm::normalize(camera.at - camera.eye);
  const glm::dvec3 right = glm::normalize(glm::cross(fwd, camera.up));
  const glm::dvec3 up = glm::cross(right, fwd);
  const double width = size.width, height = size.height;
  const double a = camera.parallel_height ? *camera.parallel_height / 2
                                          : std::tan(glm::radians(camera.fovy_deg) / 2);
  const double u = (2 * (column + 0.5) / width - 1) * a * width / height;
  const double v = (1 - 2 * (row + 0.5) / height) * a;
  if (camera.parallel_height) return {camera.eye + u * right + v * up, fwd};
  return {camera.eye, glm::normalize(fwd + u * right + v * up)};
}

/// [enter, exit] of the ray in the box from voxel 0 to voxel dims - 1 of a volume whose axes are
/// the world's; enter is not below 0. Empty: enter > exit.
struct OracleInterval {
  double enter, exit;
};

inline OracleInterval oracle_interval(const OracleRay &ray, const VolumeInfo &info) {
  OracleInterval result{0.0, std::numeric_limits<double>::infinity()};
  for (int axis = 0; axis < 3; ++axis) {
    const double low = info.origin[axis], high = low + info.spacing[axis] * (info.dims[axis] - 1);
    const double eye = ray.eye[axis], d = ray.direction[axis];
    if (d == 0.0) {
      if (eye < low || eye > high) result.exit = -1.0;
      continue;
    }
    result.enter = std::max(result.enter, (d > 0 ? low - eye : high - eye) / d);
    result.exit = std::min(result.exit, (d > 0 ? high - eye : low - eye) / d);
  }
  return result;
}

/// A trilinear field, so that interpolation adds no error of its own.
struct ExactField {
  /// Value at a position in index space; voxel values must be exact in float32.
  std::function<double(const glm::dvec3 &)> value;
  /// Gradient there, per voxel.
  std::function<glm::dvec3(const glm::dvec3 &)> gradient;
  /// All t at which the field is 0 along origin + t * direction (index space), in any order.
  std::function<std::vector<double>(const glm::dvec3 &, const glm::dvec3 &)> roots;
};

/// Roots of a t^2 + b t + c.
inline std::vector<double> quadratic_roots(double a, double b, double c) {
  if (a == 0.0) return b == 0.0 ? std::vector<double>{} : std::vector<double>{-c / b};
  const double discriminant = b * b - 4 * a * c;
  if (discriminant < 0.0) return {};
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
  return q == 0.0 ? std::vector<double>{0.0, 0.0} : std::vector<double>{q / a, c / q};
}

/// n.p - d.
inline ExactField plane_field(const glm::dvec3 &n, double d) {
  return {[=](const glm::dvec3 &p) { return glm::dot(n, p) - d; },
          [=](const glm::dvec3 &) { return n; },
          [=](const glm::dvec3 &o, const glm::dvec3 &r) {
            return quadratic_roots(0.0, glm::dot(n, r), glm::dot(n, o) - d);
          }};
}

/// (x - cx)(y - cy) + k (z - cz): up to two roots along a ray.
inline ExactField saddle_field(const glm::dvec3 &c, double k) {
  return {[=](const glm::dvec3 &p) { return (p.x - c.x) * (p.y - c.y) + k * (p.z - c.z); },
          [=](const glm::dvec3 &p) {
            return glm::dvec3{p.y - c.y, p.x - c.x, k};
          },
          [=](const glm::dvec3 &o, const glm::dvec3 &r) {
            return quadratic_roots(r.x * r.y, r.x * (o.y - c.y) + r.y * (o.x - c.x) + k * r.z,
                                   (o.x - c.x) * (o.y - c.y) + k * (o.z - c.z));
          }};
}

/// (x - cx)(y - cy)(z - cz): a true cubic with its three roots at planes.
inline ExactField three_planes_field(const glm::dvec3 &c) {
  return {[=](const glm::dvec3 &p) { return (p.x - c.x) * (p.y - c.y) * (p.z - c.z); },
          [=](const glm::dvec3 &p) {
            const glm::dvec3 q = p - c;
            return glm::dvec3{q.y * q.z, q.x * q.z, q.x * q.y};
          },
          [=](const glm::dvec3 &o, const glm::dvec3 &r) {
            std::vector<double> roots;
            for (int axis = 0; axis < 3; ++axis) {
              if (r[axis] != 0.0) roots.push_back((c[axis] - o[axis]) / r[axis]);
            }
            return roots;
          }};
}

/// How far t of a float32 renderer may be from the root t of `field` along a ray: every term of the
/// position and of the field's value, over the slope, plus the root finder's last step. u = 2^-24,
/// half an ulp of 1.
///
/// Direction, per axis: the basis is rounded (1 u), u and v are products of two rounded factors (2
/// u), two fma (2 u), the length (4 u) and the division (1 u), on terms that sum to at most
/// sqrt(3): below 16 u. Position in the cell: that times t, the rounded eye, and the rounding to
/// float32. Value: three levels of lerp and three of de Casteljau, two roundings each on convex
/// combinations of corners, which differ from 0 by at most the gradient's absolute sum there: below
/// 20 u of it (corners are exact here).
inline double depth_tolerance(const ExactField &field, const VolumeInfo &info, const OracleRay &ray,
                              double t) {
  constexpr double u = 0x1p-24;
  const glm::dvec3 eye = (ray.eye - info.origin) / info.spacing,
                   direction = ray.direction / info.spacing;
  const glm::dvec3 position = eye + t * direction;
  double voxel_error = 0.0, corner_sum = 0.0, longest = 0.0;
  for (int corner = 0; corner < 8;
       ++corner) {  // the gradient of a trilinear field is largest in a corner
    const glm::dvec3 at =
        glm::floor(position) + glm::dvec3{corner & 1, corner >> 1 & 1, corner >> 2};
    const glm::dvec3 gradient = glm::abs(field.gradient(at));
    const glm::dvec3 position_error = 16 * u * t / info.spacing + u * glm::abs(eye) + u;
    voxel_error = std::max(voxel_error, glm::dot(gradient, position_error));
    corner_sum = std::max(corner_sum, gradient.x + gradient.y + gradient.z);
  }
  for (int axis = 0; axis < 3; ++axis) longest = std::max(longest, std::abs(direction[axis]));
  const double slope = std::abs(glm::dot(field.gradient(position), direction));
  const double cell_length = 1.0 / longest;  // t through a cell is at most this
  return (voxel_error + 20 * u * corner_sum) / slope + 0x1p-22 * cell_length + 3 * u * t;
}

/// Compares a frame with the first change of `field >= 0` along every ray. Pixels whose answer
/// hangs on less than the tolerance are left out: rays along the box's edges, roots at the ends of
/// the interval, and pairs of roots that touch; at most `max_ambiguous` of all pixels may be such.
/// Returns the number of hits.
inline std::size_t expect_first_changes(const std::vector<HitRecord> &hits, const ExactField &field,
                                        const VolumeInfo &info, const Camera &camera,
                                        ImageSize size, double max_ambiguous = 0.02) {
  std::size_t num_ambiguous = 0, num_wrong = 0, num_found = 0;
  for (std::uint32_t pixel = 0; pixel < hits.size(); ++pixel) {
    const HitRecord &hit = hits[pixel];
    const OracleRay ray = oracle_ray(camera, size, pixel % size.width, pixel / size.width);
    const OracleInterval box = oracle_interval(ray, info);
    const glm::dvec3 eye = (ray.eye - info.origin) / info.spacing,
                     direction = ray.direction / info.spacing;
    const auto edge = [&](double t) {
      return 64 * 0x1p-24 * (std::abs(t) + glm::length(info.spacing));
    };
    std::vector<double> roots = field.roots(eye, direction);
    std::sort(roots.begin(), roots.end());
    bool ambiguous = false;
    double first = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0;
         i < roots.size() && box.exit > box.enter - edge(box.enter) && !std::isfinite(first); ++i) {
      const double t = roots[i];
      const double error = depth_tolerance(field, info, ray, t);
      ambiguous |=
          std::abs(t - box.enter) < error + edge(t) || std::abs(t - box.exit) < error + edge(t);
      ambiguous |= i + 1 < roots.size() && roots[i + 1] - t < 8 * error && t > box.enter - error;
      if (t > box.enter && t < box.exit) first = t;
    }
    if (ambiguous) {
      ++num_ambiguous;
      continue;
    }
    bool right = std::isfinite(hit.t) == std::isfinite(first);
    if (right && std::isfinite(first)) {
      ++num_found;
      right = std::abs(hit.t - first) <= depth_tolerance(field, info, ray, first);
    }
    if (!right && ++num_wrong <= 3) {
      ADD_FAILURE() << "pixel (" << pixel % size.width << "," << pixel / size.width << "): t "
                    << hit.t << ", expected " << first << " within "
                    << (std::isfinite(first) ? depth_tolerance(field, info, ray, first) : 0.0);
    }
  }
  EXPECT_EQ(num_wrong, 0u) << "of " << hits.size();
  EXPECT_LE(double(num_ambiguous), max_ambiguous * double(hits.size()));
  return num_found;
}

}  // namespace isowave::core::test
