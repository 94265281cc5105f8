#pragma once
// Private to core/api: vectors of its users and of core.

#include <glm/glm.hpp>

#include "isowave/camera.hpp"

namespace isowave {

inline glm::dvec3 to_glm(const Vector3 &v) {
  return {v[0], v[1], v[2]};
}
inline glm::vec3 to_glm(const std::array<float, 3> &v) {
  return {v[0], v[1], v[2]};
}
inline Vector3 from_glm(const glm::dvec3 &v) {
  return {v.x, v.y, v.z};
}
inline std::array<float, 3> from_glm(const glm::vec3 &v) {
  return {v.x, v.y, v.z};
}

}  // namespace isowave
