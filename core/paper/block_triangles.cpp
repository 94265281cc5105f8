#include "core/paper/block_triangles.hpp"

#include "core/mesh/cell_triangles.hpp"

namespace isowave::core {

ocl::BufferSizes BlockTriangles::sizes() {
  return {ocl::buffer_size<uchar>("cell triangles", CellTriangles{}.size())};
}

BlockTriangles::BlockTriangles(ocl::Device &device, SlotType slots)
    : device_(device),
      cell_triangles_(device, sizes()["cell triangles"]),
      count_(device, with_slots(group_defines(ISO_BLOCK_VOXELS), slots)),
      write_(device, with_slots(group_defines(ISO_BLOCK_VOXELS), slots)) {
  cell_triangles_.write(cell_triangles());
}

void BlockTriangles::count(const FrameParams &frame, const BlockCache &cache,
                           const ocl::Buffer<uint> &block_ids, const Entries &entries,
                           ocl::Buffer<uint> &num_triangles, const NoDataOnDevice &no_data) {
  count_(ocl::Range::strided(entries.end - entries.begin, ocl::kGroupSize, device_), frame,
         entries.begin, entries.end, entries.first, block_ids, cache.table, cache.inside,
         cell_triangles_, no_data.words_or(block_ids), no_data.begin, num_triangles);
}

void BlockTriangles::write(const FrameParams &frame, const BlockCache &cache,
                           const ocl::Buffer<uint> &block_ids, const Entries &entries,
                           const ocl::Buffer<uint> &offsets, std::uint32_t skipped,
                           ocl::Buffer<BlockVertex> &vertices, const NoDataOnDevice &no_data) {
  write_(ocl::Range::strided(std::uint64_t{entries.end - entries.begin} * ISO_BLOCK_VOXELS,
                             ISO_BLOCK_VOXELS, device_),
         frame, entries.begin, entries.end, entries.first, skipped, block_ids, cache.table,
         cache.values, cache.inside, cell_triangles_, no_data.words_or(block_ids), no_data.begin,
         offsets, vertices);
}

}  // namespace isowave::core
