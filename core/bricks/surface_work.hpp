#pragma once
// How much of a volume isosurfaces touch, where cuts are to share that out.

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/volume/block_box.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Blocks along an edge of the cubes whose touched blocks are counted.
inline constexpr int kWorkUnit = 4;

/// The touched blocks of each cube of a brick's own blocks, x fastest: about, by the blocks' own
/// voxels. It is a measure of work, not of what is drawn.
///
/// brick  in memory; its own blocks begin and end with cubes, or with the volume
std::vector<std::uint32_t> count_touched(const CompressedVolume &brick,
                                         std::span<const float> isovalues);

/// Touched blocks of any box of whole cubes: a BoxWork.
class SurfaceWork {
 public:
  /// counts  of all cubes of a volume of so many blocks, x fastest
  SurfaceWork(const glm::ivec3 &blocks, std::span<const std::uint32_t> counts);
  std::uint64_t operator()(const BlockBox &box) const;

 private:
  std::uint64_t before(const glm::ivec3 &cube) const;

  glm::ivec3 cubes_;
  std::vector<std::uint64_t> sums_;  ///< of the cubes below a corner along all axes
};

}  // namespace isowave::core
