#pragma once
// Voxels that are hard for a zfp coder, each kind in its own way.

#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <vector>

#include "tests/stage_support.hpp"

namespace isowave::core {

enum class ValueKind { kRandom, kSmooth, kConstant, kZero, kHuge, kTiny, kMixed };
inline constexpr ValueKind kValueKinds[] = {
    ValueKind::kRandom, ValueKind::kSmooth, ValueKind::kConstant, ValueKind::kZero,
    ValueKind::kHuge,   ValueKind::kTiny,   ValueKind::kMixed};

inline std::vector<float> make_voxels(ValueKind kind, const glm::uvec3 &dims, uint seed) {
  std::vector<float> voxels = random_voxels(dims, -1.0f, 1.0f, seed);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    float &v = voxels[i];
    const float x = static_cast<float>(i % dims.x), y = static_cast<float>(i / dims.x % dims.y);
    switch (kind) {
      case ValueKind::kRandom:
        break;
      case ValueKind::kSmooth:
        v = std::sin(0.3f * x) + 0.1f * y;
        break;
      case ValueKind::kConstant:
        v = 127.0f;
        break;
      case ValueKind::kZero:
        v = 0.0f;
        break;
      case ValueKind::kHuge:
        v *= 1e37f;
        break;
      case ValueKind::kTiny:
        v = v < 0 ? -1e-29f : 3e-29f * v;
        break;
      case ValueKind::kMixed:
        v = std::ldexp(v, static_cast<int>(i / 64 % 200) - 90);
        break;
    }
  }
  return voxels;
}

}  // namespace isowave::core
