#pragma once
// The twin of a drawn mesh: the same triangles (reference/mesh_twin.hpp), and the same test of a
// ray and a triangle (kernels_cl/portable/raster.h), of every pixel with every triangle. It does
// not look for the pixels that a triangle may cover, and needs no order and no atomics.

#include <span>
#include <vector>

#include "core/view/frame.hpp"
#include "kernels_cl/portable/block_vertex.h"

namespace isowave::core {

/// The triangles of an isosurface as kernels write them for drawing, in the order of
/// active_blocks.cl.
///
/// dims, voxels  of the volume, [nz][ny][nx]
/// Returns       [3 * triangles]
std::vector<BlockVertex> triangles_scalar(const glm::uvec3 &dims, std::span<const float> voxels,
                                          float isovalue);

/// The hits [height * width] of such triangles.
///
/// threads  0: one per core
std::vector<HitRecord> rasterise_scalar(const FrameParams &frame,
                                        std::span<const BlockVertex> vertices,
                                        unsigned threads = 0);

}  // namespace isowave::core
