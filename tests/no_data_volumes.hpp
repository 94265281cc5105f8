#pragma once
// Volumes some of whose voxels have no data.

#include <functional>
#include <limits>
#include <vector>

#include "core/zfp/zfp_stream.hpp"
#include "tests/array_reader.hpp"

namespace isowave::core::test {

inline constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

/// Says of a voxel whether it has no data.
using Hole = std::function<bool(const glm::uvec3 &at)>;

inline std::vector<float> with_hole(const glm::uvec3 &dims, std::vector<float> voxels,
                                    const Hole &hole, float value = kNone) {
  std::size_t i = 0;
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x, ++i) {
        if (hole({x, y, z})) voxels[i] = value;
      }
    }
  }
  return voxels;
}

struct NamedHole {
  const char *name;
  Hole hole;
};

/// Holes of a volume of dims.
inline std::vector<NamedHole> holes(const glm::uvec3 &dims) {
  const auto scattered = [dims](const glm::uvec3 &at) {
    const std::uint32_t number = at.x + dims.x * (at.y + dims.y * at.z);
    return (number * 2654435761u >> 16) % 23 == 0;
  };
  return {{"half", [=](const glm::uvec3 &at) { return at.x > dims.x / 2; }},
          {"a voxel", [=](const glm::uvec3 &at) { return at == dims / 2u; }},
          {"scattered", scattered},
          {"all", [](const glm::uvec3 &) { return true; }},
          {"the border",
           [=](const glm::uvec3 &at) {
             return at.x == 0 || at.y == 0 || at.z == 0 || at.x + 1 == dims.x ||
                    at.y + 1 == dims.y || at.z + 1 == dims.z;
           }},
          {"partial blocks", [=](const glm::uvec3 &at) {
             return at.x / 4 == (dims.x - 1) / 4 || at.z / 4 == (dims.z - 1) / 4;
           }}};
}

inline CompressedVolume compressed(const glm::uvec3 &dims, const std::vector<float> &voxels,
                                   const CompressOptions &options = {.rate = 12}) {
  ArrayReader reader(dims, voxels);
  return compress(reader, options);
}

}  // namespace isowave::core::test
