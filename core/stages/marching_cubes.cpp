#include "core/stages/marching_cubes.hpp"

#include <stdexcept>

#include "core/mesh/cell_triangles.hpp"

namespace isowave::core {

ocl::BufferSizes SurfaceCounts::sizes(std::uint64_t num_listed) {
  return {ocl::buffer_size<uint>("listed blocks", num_listed),
          ocl::buffer_size<BlockEdges>("crossed edges", num_listed),
          ocl::buffer_size<uint>("vertex offsets", num_listed + 1),
          ocl::buffer_size<uint>("triangle offsets", num_listed + 1)};
}

SurfaceCounts::SurfaceCounts(ocl::Device &device, std::uint64_t num_listed)
    : block_ids(device, sizes(num_listed)["listed blocks"]),
      edges(device, sizes(num_listed)["crossed edges"]),
      vertex_offsets(device, sizes(num_listed)["vertex offsets"]),
      triangle_offsets(device, sizes(num_listed)["triangle offsets"]) {}

ocl::BufferSizes MeshBuffers::sizes(std::uint64_t num_vertices, std::uint64_t num_triangles,
                                    Gradients gradients) {
  return {ocl::buffer_size<MeshVertex>("mesh vertices", num_vertices),
          ocl::buffer_size<float>("mesh gradients",
                                  gradients == Gradients::kSmooth ? 3 * num_vertices : 0),
          ocl::buffer_size<MeshTriangle>("mesh triangles", num_triangles)};
}

MeshBuffers::MeshBuffers(ocl::Device &device, std::uint64_t num_vertices,
                         std::uint64_t num_triangles, Gradients with)
    : vertices(device, sizes(num_vertices, num_triangles, with)["mesh vertices"]),
      gradients(device, sizes(num_vertices, num_triangles, with)["mesh gradients"]),
      triangles(device, sizes(num_vertices, num_triangles, with)["mesh triangles"]) {}

ocl::BufferSizes MarchingCubes::sizes() {
  return {ocl::buffer_size<uchar>("cell triangles", CellTriangles{}.size())};
}

MarchingCubes::MarchingCubes(ocl::Device &device, Gradients gradients, SlotType slots)
    : device_(device),
      with_gradients_(gradients == Gradients::kSmooth ? 1 : 0),
      cell_triangles_(device, sizes()["cell triangles"]),
      count_(device, with_slots(group_defines(ISO_BLOCK_VOXELS), slots)),
      write_(device, with_slots(group_defines(ISO_BLOCK_VOXELS), slots)) {
  cell_triangles_.write(cell_triangles());
}

void MarchingCubes::count(const FrameParams &frame, const BlockCache &cache, std::uint32_t begin,
                          std::uint32_t end, SurfaceCounts &surface,
                          const NoDataOnDevice &no_data) {
  count_(ocl::Range::strided(end - begin, ocl::kGroupSize, device_), frame, begin, end,
         surface.block_ids, cache.table, cache.inside, cell_triangles_,
         no_data.words_or(surface.block_ids), no_data.begin, surface.edges, surface.vertex_offsets,
         surface.triangle_offsets);
}

void MarchingCubes::write(const FrameParams &frame, const BlockCache &cache,
                          const ActiveBlocks &listed, std::uint32_t begin, std::uint32_t end,
                          const SurfaceCounts &surface, MeshBuffers &mesh,
                          const NoDataOnDevice &no_data) {
  if (end - begin > kMaxWrittenBlocks)
    throw std::invalid_argument("MarchingCubes: more blocks than vertices can name");
  write_(
      ocl::Range::strided(std::uint64_t{end - begin} * ISO_BLOCK_VOXELS, ISO_BLOCK_VOXELS, device_),
      frame, begin, end, with_gradients_, surface.block_ids, listed.masks(), listed.offsets(),
      cache.table, cache.values, cache.inside, cell_triangles_, no_data.words_or(surface.block_ids),
      no_data.begin, surface.edges, surface.vertex_offsets, surface.triangle_offsets, mesh.vertices,
      mesh.gradients, mesh.triangles);
}

}  // namespace isowave::core
