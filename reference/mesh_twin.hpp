#pragma once
// The twin of an extractor: marching cubes of a whole volume of float32, block by block in plain
// loops, by the same arithmetic (kernels_cl/portable/marching_cubes.h).

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/mesh/mesh.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

/// A mesh as kernels write it, in the order of active_blocks.cl.
struct BlockMesh {
  std::vector<glm::uvec3> blocks{};    ///< [vertices] whose vertex it is
  std::vector<MeshVertex> vertices{};  ///< edge: bits 0..7 alone
  std::vector<Gradient> gradients{};   ///< [vertices]
  std::vector<MeshTriangle> triangles{};
  std::vector<glm::uvec3> triangle_blocks{};  ///< [triangles] whose cell it is in
};

/// voxels: [nz][ny][nx].
BlockMesh extract_scalar(const glm::uvec3 &dims, std::span<const float> voxels, float isovalue);

/// The mesh, bit for bit, that an extractor gives of a volume, or a level of detail.
Mesh extract_scalar(const CompressedVolume &volume, float isovalue, bool with_normals = true,
                    VertexPlaces places = VertexPlaces::kApart);

}  // namespace isowave::core
