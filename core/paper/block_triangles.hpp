#pragma once
// Listed blocks whose values are cached -> triangles with vertices of their own, for drawing
// (kernels_cl/paper/block_triangles.cl).

#include "core/stages/block_cache.hpp"
#include "core/stages/marching_cubes.hpp"
#include "kernels/block_triangles.hpp"
#include "kernels_cl/portable/block_vertex.h"

namespace isowave::core {

class BlockTriangles {
 public:
  static ocl::BufferSizes sizes();
  explicit BlockTriangles(ocl::Device &device, SlotType slots = SlotType::kFloat32);

  /// Entries of the list that a call is for: from `begin` to below `end`. Lists that have a count
  /// for each entry begin with entry `first`.
  struct Entries {
    std::uint32_t begin = 0, end = 0, first = 0;
  };

  /// Counts the triangles of blocks.
  ///
  /// frame      its grid, and schedule.cache_slots
  /// cache      has the dual grids of these blocks, with `inside` of the isovalue at hand
  /// block_ids  [listed] of ActiveBlocks
  /// no_data    of the volume, for a device that draws it
  /// Out        num_triangles [entries.begin - entries.first, entries.end - entries.first)
  /// Waits      no
  void count(const FrameParams &frame, const BlockCache &cache, const ocl::Buffer<uint> &block_ids,
             const Entries &entries, ocl::Buffer<uint> &num_triangles,
             const NoDataOnDevice &no_data = {});

  /// Writes the triangles of blocks.
  ///
  /// frame    as for count(), and surface.isovalue
  /// offsets  prefix sums of count()
  /// skipped  taken off all offsets: of the first triangle that is written to the buffer's
  /// beginning Out      vertices, three for each triangle Waits    no
  void write(const FrameParams &frame, const BlockCache &cache, const ocl::Buffer<uint> &block_ids,
             const Entries &entries, const ocl::Buffer<uint> &offsets, std::uint32_t skipped,
             ocl::Buffer<BlockVertex> &vertices, const NoDataOnDevice &no_data = {});

 private:
  ocl::Device &device_;
  ocl::Buffer<uchar> cell_triangles_;
  ocl::Kernel<kernels::block_triangles_count> count_;
  ocl::Kernel<kernels::block_triangles_write> write_;
};

}  // namespace isowave::core
