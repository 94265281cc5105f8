#pragma once
// Some of a volume's voxels, in whole blocks, for histograms and the like.

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// Blocks that are spread over a volume, always the same ones; all blocks if they have at most
/// max_voxels voxels.
class BlockSample {
 public:
  BlockSample(const glm::uvec3 &dims, std::uint64_t max_voxels);

  std::uint64_t count() const { return count_; }
  /// Number of a sampled block; ascends with i, which is below count().
  std::uint32_t block(std::uint64_t i) const;

 private:
  std::uint64_t stride_, count_;
};

/// Decodes the sampled blocks of a volume.
///
/// Returns  [count][64] voxels x + 4y + 16z of each block; NaN: no data, or outside the volume
/// Throws   Error: a file is shorter than it was, or cannot be read
std::vector<float> decode_sample(const CompressedVolume &volume, std::uint64_t max_voxels);

/// The voxels of decode_sample() with data, about max_voxels, in no order that means anything.
///
/// Throws   Error: as above
std::vector<float> sample_voxels(const CompressedVolume &volume, std::uint64_t max_voxels);

/// Collects what decode_sample() would return from the layers of a volume that is not compressed.
class LayerSampler {
 public:
  LayerSampler(const glm::uvec3 &dims, std::uint64_t max_voxels);

  /// Takes layer z, [ny][nx]; layers come in ascending order.
  template <class Value>
  void add_layer(std::uint32_t z, std::span<const Value> layer) {
    begin_layer(z);
    for (std::uint64_t i = first_; i < end_; ++i) {
      const glm::uvec3 at = first_voxel(i);
      for (std::uint32_t y = at.y; y < std::min(at.y + 4, dims_.y); ++y) {
        for (std::uint32_t x = at.x; x < std::min(at.x + 4, dims_.x); ++x) {
          voxels_[ISO_BLOCK_VOXELS * i + x % 4 + 4 * (y % 4) + 16 * (z % 4)] =
              static_cast<float>(layer[x + std::uint64_t{dims_.x} * y]);
        }
      }
    }
  }
  /// [count][64]; NaN: a layer that was not given, or outside the volume.
  std::vector<float> &voxels() { return voxels_; }

 private:
  void begin_layer(std::uint32_t z);
  glm::uvec3 first_voxel(std::uint64_t i) const;

  glm::uvec3 dims_;
  BlockSample sample_;
  std::vector<float> voxels_;
  std::uint64_t first_ = 0, end_ = 0;  ///< sampled blocks that the layer crosses
};

}  // namespace isowave::core
