#pragma once
// A box of a compressed volume's voxels, decoded without the rest.

#include <cstdint>
#include <glm/glm.hpp>
#include <span>

#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Voxels begin, begin + step, ... below end, along x, y, z.
struct VoxelRegion {
  glm::uvec3 begin{0};
  glm::uvec3 end{0};
  glm::uvec3 step{1};

  /// Voxels along each axis, if check_region() accepts the region.
  glm::uvec3 dims() const { return (end - begin - 1u) / step + 1u; }
};

/// Throws  Error unless each side has a voxel, and all are voxels of a volume of dims
void check_region(const VoxelRegion &region, const glm::uvec3 &dims);

/// Decodes a region. Only blocks with voxels of the region are decoded, and read if the volume is
/// in a file. The bits are decode_with_libzfp()'s.
///
/// out     [nz][ny][nx] of region.dims()
/// Throws  Error: check_region(); a file is shorter than it was, or cannot be read
void decode_region(const CompressedVolume &volume, const VoxelRegion &region, std::span<float> out);

}  // namespace isowave::core
