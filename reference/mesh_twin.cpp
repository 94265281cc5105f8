#include "reference/mesh_twin.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/mesh/cell_triangles.hpp"
#include "core/view/frame.hpp"

namespace isowave::core {

namespace {

class MeshTwin {
 public:
  MeshTwin(const glm::uvec3 &dims, std::span<const float> voxels, float isovalue)
      : dims_(dims), voxels_(voxels), isovalue_(isovalue) {
    VolumeInfo info;
    info.dims = dims;
    grid_ = make_grid(info);
    edges_.resize(block_count(grid_));
    first_vertex_.resize(edges_.size());
  }

  BlockMesh run() {
    each_block([&](const BlockCoords &b) {
      first_vertex_[place(b)] = num_vertices_;
      edges_[place(b)] = with_data(b, crossed_edges(&grid_, b, signs_of(b).data()));
      num_vertices_ += vertex_count(edges_[place(b)]);
    });
    each_block([&](const BlockCoords &b) {
      add_vertices(b);
      add_triangles(b);
    });
    return std::move(mesh_);
  }

 private:
  std::size_t place(const BlockCoords &b) const {
    return b.x + std::size_t{grid_.blocks_x} * (b.y + std::size_t{grid_.blocks_y} * b.z);
  }
  float voxel(const glm::ivec3 &at) const {
    const glm::uvec3 p(at);
    return voxels_[p.x + std::size_t{dims_.x} * (p.y + std::size_t{dims_.y} * p.z)];
  }

  /// By macrocells of 4^3 blocks, then by their blocks.
  template <class Visit>
  void each_block(const Visit &visit) const {
    const glm::uvec3 blocks(grid_.blocks_x, grid_.blocks_y, grid_.blocks_z),
        coarse = (blocks + 3u) / 4u;
    for (std::uint32_t cell = 0; cell < coarse.x * coarse.y * coarse.z; ++cell) {
      const glm::uvec3 first =
          4u * glm::uvec3(cell % coarse.x, cell / coarse.x % coarse.y, cell / coarse.x / coarse.y);
      for (std::uint32_t bit = 0; bit < 64; ++bit) {
        const glm::uvec3 b = first + glm::uvec3(bit % 4, bit / 4 % 4, bit / 16);
        if (glm::all(glm::lessThan(b, blocks))) visit(BlockCoords{b.x, b.y, b.z});
      }
    }
  }

  /// corners_inside() of a block's cells; voxels beyond the domain are outside.
  std::array<ulong, 8> signs_of(const BlockCoords &b) const {
    std::array<ulong, 8> inside{}, signs{};
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      for (std::uint32_t v = 0; v < 64; ++v) {
        const glm::uvec3 at = 4u * (glm::uvec3(b.x, b.y, b.z) +
                                    glm::uvec3(corner & 1, corner >> 1 & 1, corner >> 2)) +
                              glm::uvec3(v % 4, v / 4 % 4, v / 16);
        if (glm::all(glm::lessThan(at, dims_)) && voxel(glm::ivec3(at)) >= isovalue_)
          inside[corner] |= ulong{1} << v;
      }
    }
    corners_inside(inside.data(), signs.data());
    return signs;
  }

  bool has_data(const glm::ivec3 &cell) const {
    for (int corner = 0; corner < 8; ++corner) {
      if (std::isnan(voxel(cell + glm::ivec3(corner & 1, corner >> 1 & 1, corner >> 2))))
        return false;
    }
    return true;
  }

  /// Does one of the up to four cells around the edge from `lower` along `axis` have data?
  bool has_data(const glm::ivec3 &lower, int axis) const {
    for (int i = 0; i < 4; ++i) {
      glm::ivec3 cell = lower;
      cell[(axis + 1) % 3] -= i & 1;
      cell[(axis + 2) % 3] -= i >> 1;
      if (glm::all(glm::greaterThanEqual(cell, glm::ivec3(0))) &&
          glm::all(glm::lessThan(cell + 1, glm::ivec3(dims_))) && has_data(cell))
        return true;
    }
    return false;
  }

  BlockEdges with_data(const BlockCoords &b, BlockEdges edges) const {
    for (std::uint32_t v = 0; v < 64; ++v) {
      const glm::ivec3 lower = 4 * glm::ivec3(b.x, b.y, b.z) + glm::ivec3(v % 4, v / 4 % 4, v / 16);
      int axis = 0;
      for (ulong *of_axis : {&edges.x, &edges.y, &edges.z}) {
        if ((*of_axis >> v & 1) != 0 && !has_data(lower, axis)) *of_axis &= ~(ulong{1} << v);
        ++axis;
      }
    }
    return edges;
  }

  std::array<float, 3> gradient(const glm::ivec3 &at) const {
    std::array<float, 3> result{};
    for (int axis = 0; axis < 3; ++axis) {
      const int last = static_cast<int>(dims_[axis]) - 1;
      glm::ivec3 below = at, above = at;
      below[axis] = std::max(at[axis] - 1, 0);
      above[axis] = std::min(at[axis] + 1, last);
      result.at(axis) = derivative_with_data(voxel(below), voxel(at), voxel(above), at[axis], last);
    }
    return result;
  }

  void add_vertices(const BlockCoords &b) {
    const BlockEdges &edges = edges_[place(b)];
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const ulong own = axis == 0 ? edges.x : axis == 1 ? edges.y : edges.z;
      for (std::uint32_t v = 0; v < 64; ++v) {
        if ((own >> v & 1) == 0) continue;
        const glm::ivec3 lower =
            4 * glm::ivec3(b.x, b.y, b.z) + glm::ivec3(v % 4, v / 4 % 4, v / 16);
        glm::ivec3 upper = lower;
        ++upper[static_cast<int>(axis)];
        const float t = edge_crossing(voxel(lower), voxel(upper), isovalue_);
        mesh_.blocks.emplace_back(b.x, b.y, b.z);
        mesh_.vertices.push_back({axis << 6 | v, t});
        mesh_.gradients.push_back(vertex_gradient(gradient(lower).data(), gradient(upper).data(), t,
                                                  axis, voxel(upper) - voxel(lower)));
      }
    }
  }

  std::uint32_t vertex_of(const BlockCoords &b, std::uint32_t cell, std::uint32_t edge) const {
    const std::uint32_t corner = edge_corner(edge);
    const std::uint32_t x = (cell & 3) + (corner & 1), y = (cell >> 2 & 3) + (corner >> 1 & 1),
                        z = (cell >> 4) + (corner >> 2);
    const std::size_t block = place({b.x + x / 4, b.y + y / 4, b.z + z / 4});
    const BlockEdges &edges = edges_[block];
    return first_vertex_[block] + vertex_rank(edges.x, edges.y, edges.z, edge_axis(edge),
                                              x % 4 + 4 * (y % 4) + 16 * (z % 4));
  }

  void add_triangles(const BlockCoords &b) {
    const std::array<ulong, 8> signs = signs_of(b);
    const ulong cells = domain_of_block(&grid_, b, 1, 1, 1);
    for (std::uint32_t cell = 0; cell < 64; ++cell) {
      const glm::ivec3 at =
          4 * glm::ivec3(b.x, b.y, b.z) + glm::ivec3(cell % 4, cell / 4 % 4, cell / 16);
      if ((cells >> cell & 1) == 0 || !has_data(at)) continue;
      const uchar *entry =
          &cell_triangles().at(std::size_t{ISO_CASE_BYTES} * cell_signs(signs.data(), cell));
      for (std::uint32_t i = 0; i < entry[0]; ++i) {
        mesh_.triangles.push_back({vertex_of(b, cell, entry[1 + 3 * i]),
                                   vertex_of(b, cell, entry[2 + 3 * i]),
                                   vertex_of(b, cell, entry[3 + 3 * i])});
        mesh_.triangle_blocks.emplace_back(b.x, b.y, b.z);
      }
    }
  }

  glm::uvec3 dims_;
  std::span<const float> voxels_;
  float isovalue_;
  BlockGrid grid_{};
  std::vector<BlockEdges> edges_;  // by block
  std::vector<std::uint32_t> first_vertex_;
  std::uint32_t num_vertices_ = 0;
  BlockMesh mesh_;
};

}  // namespace

BlockMesh extract_scalar(const glm::uvec3 &dims, std::span<const float> voxels, float isovalue) {
  return MeshTwin(dims, voxels, isovalue).run();
}

Mesh extract_scalar(const CompressedVolume &volume, float isovalue, bool with_normals,
                    VertexPlaces places) {
  const std::vector<float> voxels = decode_with_libzfp(volume);
  const BlockMesh blocks = extract_scalar(volume.info.dims, voxels, isovalue);
  const MeshPlacement placement(volume.info, places);
  Mesh mesh;
  for (std::size_t i = 0; i < blocks.vertices.size(); ++i) {
    mesh.vertices.push_back(placement.position(blocks.blocks[i], blocks.vertices[i]));
    if (with_normals) mesh.normals.push_back(placement.normal(blocks.gradients[i]));
  }
  for (const MeshTriangle &triangle : blocks.triangles)
    mesh.triangles.push_back(placement.triangle(triangle));
  return mesh;
}

}  // namespace isowave::core
