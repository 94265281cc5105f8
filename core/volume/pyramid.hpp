#pragma once
// Levels of detail: a pyramid of grids, each with half the voxels of the one before along each
// axis.
//
// Voxel k of a level lies at voxel 2k of the level before, so planes of a coarse grid are planes of
// the fine one, and a ray crosses both at the same t, bit for bit. The value of voxel k is a mean
// of five voxels along each axis, by -1/16, 1/4, 5/8, 1/4, -1/16, clamped to their range. So a
// field that bends evenly keeps its values, and surfaces keep their place; positive weights would
// shrink them. Behind the last voxel lie copies of it, and a coarse grid may end up to one of its
// voxels behind the fine one.
//
// A voxel without data is NaN here. Axis by axis, a coarse voxel has data if the fine voxel at its
// place has data, or lies between two with data: the fine voxel is then taken to be their mean.
// Behind the last voxel with data lie copies of it (core/zfp/README.md).

#include <cstdint>
#include <deque>
#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/volume/voxel_chunks.hpp"

namespace isowave::core {

inline constexpr std::uint32_t kMaxLevels = 16;

/// The grid of the next coarser level: n / 2 + 1 voxels along an axis of n, twice the spacing,
/// float32.
VolumeInfo coarser_level(const VolumeInfo &fine);
/// How many levels a volume can have, itself among them: halved while the shortest axis keeps at
/// least 8 voxels.
std::uint32_t max_levels(const glm::uvec3 &dims);

/// Makes the voxels of the next coarser level from those of a level, in memory O(nx * ny).
class Downsampler {
 public:
  /// Takes the coarse level's chunks in order. Their voxels without data are NaN.
  using Sink = std::function<void(const Chunk &)>;
  /// num_threads: 0: one per processor; the result is the same for any number.
  Downsampler(const glm::uvec3 &fine_dims, std::uint32_t num_threads, Sink sink);
  /// The next layers [n][ny][nx] of the fine level; NaN: voxels without data.
  void add(std::span<const float> layers);

 private:
  void add_plane(std::uint32_t z, std::span<const float> plane);
  void emit(std::uint32_t last);

  glm::uvec3 fine_, coarse_;
  std::uint32_t num_threads_;
  Sink sink_;
  std::uint32_t z_ = 0;                    ///< of the next fine layer
  std::uint32_t num_emitted_ = 0;          ///< coarse layers
  std::uint32_t chunk_begin_ = 0;          ///< the first of them in chunk_
  std::vector<float> planes_;              ///< fine layers, downsampled along x and y
  std::deque<std::vector<float>> recent_;  ///< the last of them
  std::vector<float> chunk_;
};

/// The voxels of the next coarser level of voxels [nz][ny][nx].
std::vector<float> downsample(const glm::uvec3 &dims, std::span<const float> voxels);

}  // namespace isowave::core
