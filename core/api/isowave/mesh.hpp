#pragma once
// Isosurfaces as triangle meshes, in memory or in files.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "isowave/volume.hpp"

namespace isowave {

/// Where vertices are on the edges between voxels.
enum class VertexPlaces {
  /// At least 1/1024 of the edge away from its voxels. So no two vertices meet, no triangle is
  /// without area, and programs that merge vertices by position find the mesh closed.
  kApart,
  kExact  ///< where the isovalue is crossed; on a voxel that equals it, vertices meet
};

struct ExtractOptions {
  std::uint32_t level = 0;   ///< of detail; 0: the volume itself
  bool with_normals = true;  ///< needs more blocks around the surface
  VertexPlaces vertices = VertexPlaces::kApart;
  /// Bound on the device's memory, on the host on value ranges and decoded blocks [bytes]; 0: three
  /// quarters of the device's memory, a quarter of the host's.
  std::uint64_t memory_budget = 0;
  /// Decoded blocks of 4^3 voxels that a device keeps at most, 17 and more (without normals 8); 0:
  /// as many as the surface needs and the budget allows. The mesh does not depend on it.
  std::uint32_t cache_blocks = 0;
  /// Called from the calling thread: what is done, and how much of it, 0 to 1; before each kernel
  /// is compiled, too. What it throws ends the extraction.
  std::function<void(std::string_view what, double done)> progress{};
};

/// Triangles that share their vertices. Each edge of a triangle belongs to another one, too, but
/// for those in the volume's border.
struct Mesh {
  /// World space; rounded if Volume::float32_positions().
  std::vector<Vector3> vertices{};
  /// A normal of each vertex, in world space, of length 1, away from larger values; empty without
  /// normals.
  std::vector<std::array<float, 3>> normals{};
  /// Numbers of vertices, counter-clockwise seen from where values are lower.
  std::vector<std::array<std::uint32_t, 3>> triangles{};
};

/// Extracts the isosurface by marching cubes on the host, and waits for it: the mesh that a device
/// extracts (isowave/extract.hpp), bit for bit.
///
/// options  without cache_blocks
/// Throws   Error: NaN, a level that there is not, a budget that does not suffice (names what
///          would), 2^32 vertices and more
Mesh extract(const std::shared_ptr<const Volume> &volume, double isovalue,
             const ExtractOptions &options = {});

/// The same to a file, for surfaces larger than memory: parts go to disk as they come, in the
/// file's folder, which holds the mesh twice for a while. The file appears whole or not at all.
///
/// path     ends in .ply, .stl, .obj, .vtp, .gltf or .glb. Positions that float32 does not hold are
///          float64 in .ply, .obj and .vtp; in glTF they are a node's, which has a translation
/// Returns  a line for users, or nothing. STL has float32 alone: far from the origin, the line says
///          what is to be added to its positions, as the file's header does
/// Throws   Error: as above; the file cannot be written, or the format does not hold so much
std::string extract_to_file(const std::shared_ptr<const Volume> &volume, double isovalue,
                            const std::filesystem::path &path, const ExtractOptions &options = {});

/// Writes a mesh to such a file.
///
/// Returns  as extract_to_file()
/// Throws   Error: as many normals as vertices, or none, are needed; triangles of vertices that
///          there are not; the file cannot be written
std::string save_mesh(const Mesh &mesh, const std::filesystem::path &path);

}  // namespace isowave
