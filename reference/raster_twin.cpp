#include "reference/raster_twin.hpp"

#include "core/base/parallel_for.hpp"
#include "core/paper/rasterise.hpp"
#include "kernels_cl/portable/raster.h"
#include "reference/mesh_twin.hpp"

namespace isowave::core {

std::vector<BlockVertex> triangles_scalar(const glm::uvec3 &dims, std::span<const float> voxels,
                                          float isovalue) {
  VolumeInfo info;
  info.dims = dims;
  const FrameParams frame = make_grid_params(info);
  const BlockMesh mesh = extract_scalar(dims, voxels, isovalue);
  std::vector<BlockVertex> vertices;
  vertices.reserve(3 * mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const glm::uvec3 block = mesh.triangle_blocks[i];
    const MeshTriangle &triangle = mesh.triangles[i];
    for (const uint number : {triangle.a, triangle.b, triangle.c}) {
      const auto &[edge, t] = mesh.vertices[number];
      const glm::uvec3 lower =
          4u * (mesh.blocks[number] - block) + glm::uvec3(edge & 3, edge >> 2 & 3, edge >> 4 & 3);
      glm::vec3 place(lower);
      place[static_cast<int>(edge >> 6)] += t;
      vertices.push_back(
          {pack_steps(place.x, place.y, place.z), block_id_at(&frame, block.x, block.y, block.z)});
    }
  }
  return vertices;
}

std::vector<HitRecord> rasterise_scalar(const FrameParams &frame,
                                        std::span<const BlockVertex> vertices, unsigned threads) {
  const RasterView view = make_raster_view(frame.view);
  std::vector<ViewTriangle> triangles;
  for (std::size_t i = 0; i < vertices.size(); i += 3)
    triangles.push_back(view_triangle(&frame, &view, &vertices[i]));
  std::vector<HitRecord> hits(std::size_t{frame.view.width} * frame.view.height, no_hit());
  parallel_for(frame.view.height, threads, [&](std::uint64_t row, std::uint32_t) {
    const float v = row_v(&frame, static_cast<uint>(row));
    for (uint column = 0; column < frame.view.width; ++column) {
      const float u = column_u(&frame, column);
      HitRecord &nearest = hits[row * frame.view.width + column];
      for (std::size_t i = 0; i < triangles.size(); ++i) {
        TriangleHit at;
        if (!ray_meets_triangle(u, v, &triangles[i], &at)) continue;
        const HitRecord hit = triangle_hit(&frame, &vertices[3 * i], u, v, at);
        if (hit.t < nearest.t) nearest = hit;
      }
    }
  });
  return hits;
}

}  // namespace isowave::core
