#pragma once
// The blocks that isosurfaces touch, for cuts that share them out.

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/volume/block_box.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Blocks along an edge of the cubes whose touched blocks are counted.
inline constexpr int kWorkUnit = 4;

/// About how many blocks are touched in each cube of a brick's own blocks, x fastest. Only the
/// blocks' own voxels count: this measures work, not what is drawn.
///
/// brick  in memory; its own blocks begin and end with cubes, or with the volume
std::vector<std::uint32_t> count_touched(const CompressedVolume &brick,
                                         std::span<const float> isovalues);

/// Touched blocks of any box of whole cubes: a BoxWork.
class SurfaceWork {
 public:
  /// blocks  blocks of the volume, along each axis
  /// counts  touched blocks of all its cubes, x fastest
  SurfaceWork(const glm::ivec3 &blocks, std::span<const std::uint32_t> counts);
  std::uint64_t operator()(const BlockBox &box) const;

 private:
  std::uint64_t before(const glm::ivec3 &cube) const;

  glm::ivec3 cubes_;
  std::vector<std::uint64_t> sums_;  ///< of the cubes below a corner along all axes
};

}  // namespace isowave::core
