#pragma once
// Private to core/api: what pages say of a volume's values beside its facts.

#include <array>
#include <cstdint>
#include <vector>

#include "isowave/volume.hpp"

namespace isowave {

struct VoxelHistogram {
  std::vector<std::uint64_t> counts;  ///< of bins of one width; integers have whole ones
  std::array<float, 2> range;         ///< that the bins divide
  std::vector<double> suggested;      ///< suggested_isovalues()
};

/// [least, largest] voxel, or if the file does not say, that of a sample.
std::array<float, 2> range_or_sampled(const Volume &volume);
/// Decodes a sample of the blocks.
VoxelHistogram voxel_histogram(const Volume &volume);

}  // namespace isowave
