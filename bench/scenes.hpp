#pragma once
// The volumes of the stage benchmarks. All are made by code, the same on every machine.

#include <cstdint>
#include <vector>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core::bench {

/// mixing_layer in an edge^3 cube, compressed at `rate` bits per voxel, with so many levels of
/// detail; its surface is at 0.5. Kept for the rest of the run.
const CompressedVolume &mixing_layer(std::int64_t edge, std::int64_t rate = 4,
                                     std::uint32_t levels = 1);
inline constexpr float kMixingLayerIsovalue = 0.5f;

/// The same as voxels of uint8, without a loss: blocks have lengths of their own.
const CompressedVolume &exact_mixing_layer(std::int64_t edge);

/// blocks_x * blocks_y * 2 blocks: a wavy surface at isovalue 0 passes through every block of the
/// first layer; those of the second own no cell. Seen along z, each ray has exactly one block to
/// test.
CompressedVolume wavy_slab(std::uint32_t blocks_x, std::uint32_t blocks_y);

/// Numbers from a fixed seed, the same with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed = 1) : state_(seed) {}
  /// In [0, bound), bound > 0.
  std::uint32_t below(std::uint64_t bound);
  /// The entries in random order.
  void shuffle(std::vector<std::uint32_t> &entries);

 private:
  std::uint64_t state_;
};

}  // namespace isowave::core::bench
