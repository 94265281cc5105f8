#pragma once
// Listed blocks whose values are cached -> vertices and triangles of their isosurface
// (kernels_cl/marching_cubes.cl).

#include "core/stages/active_blocks.hpp"
#include "core/stages/block_cache.hpp"
#include "core/stages/request_surface.hpp"
#include "core/stream/device_stream.hpp"
#include "kernels/marching_cubes.hpp"
#include "kernels_cl/portable/marching_cubes.h"

namespace isowave::core {

/// Vertices and triangles of one block at most.
inline constexpr std::uint32_t kBlockVertices = 3 * ISO_BLOCK_VOXELS,
                               kBlockTriangles = ISO_CELL_TRIANGLES * ISO_BLOCK_VOXELS;
/// Entries of the list that may be written at a time: MeshVertex::edge.
inline constexpr std::uint32_t kMaxWrittenBlocks = 1u << (32 - ISO_VERTEX_BLOCK_SHIFT);

/// Counts of the surface in each block of a list.
struct SurfaceCounts {
  static ocl::BufferSizes sizes(std::uint64_t num_listed);
  SurfaceCounts(ocl::Device &device, std::uint64_t num_listed);

  ocl::Buffer<uint> block_ids;         ///< [listed] of ActiveBlocks
  ocl::Buffer<BlockEdges> edges;       ///< [listed] that have a vertex
  ocl::Buffer<uint> vertex_offsets;    ///< [listed + 1] vertices of each block; then prefix sums
  ocl::Buffer<uint> triangle_offsets;  ///< [listed + 1] the same for triangles
};

/// Vertices and triangles of a batch of blocks.
struct MeshBuffers {
  static ocl::BufferSizes sizes(std::uint64_t num_vertices, std::uint64_t num_triangles,
                                Gradients gradients);
  MeshBuffers(ocl::Device &device, std::uint64_t num_vertices, std::uint64_t num_triangles,
              Gradients gradients);

  ocl::Buffer<MeshVertex> vertices;
  ocl::Buffer<float>
      gradients;  ///< [3 * vertices] x, y, z [value per voxel], index space; or empty
  ocl::Buffer<MeshTriangle> triangles;
};

class MarchingCubes {
 public:
  static ocl::BufferSizes sizes();
  MarchingCubes(ocl::Device &device, Gradients gradients, SlotType slots = SlotType::kFloat32);

  /// Counts the vertices and triangles of entries [begin, end) of the list.
  ///
  /// frame    its grid, and schedule.cache_slots
  /// cache    has the dual grids of these blocks, with `inside` of the isovalue at hand
  /// no_data  of the volume, for a device that draws it
  /// Out      surface.edges, .vertex_offsets, .triangle_offsets [begin, end): counts
  /// Waits    no
  void count(const FrameParams &frame, const BlockCache &cache, std::uint32_t begin,
             std::uint32_t end, SurfaceCounts &surface, const NoDataOnDevice &no_data = {});

  /// Writes vertices and triangles of entries [begin, end), at most kMaxWrittenBlocks.
  ///
  /// frame    as for count(), and surface.isovalue
  /// cache    has all that these blocks need (RequestSurface)
  /// surface  of the whole list, with offsets instead of counts
  /// Out      mesh, from its beginning on: vertex_offsets[end] - vertex_offsets[begin] vertices and
  ///          as many triangles, whose vertices are numbered through the whole list
  /// Waits    no
  void write(const FrameParams &frame, const BlockCache &cache, const ActiveBlocks &listed,
             std::uint32_t begin, std::uint32_t end, const SurfaceCounts &surface,
             MeshBuffers &mesh, const NoDataOnDevice &no_data = {});

 private:
  ocl::Device &device_;
  uint with_gradients_;
  ocl::Buffer<uchar> cell_triangles_;
  ocl::Kernel<kernels::marching_cubes_count> count_;
  ocl::Kernel<kernels::marching_cubes_write> write_;
};

}  // namespace isowave::core
