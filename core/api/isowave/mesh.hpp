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

/// Places of vertices on the edges between voxels.
enum class VertexPlaces {
  /// At least 1/1024 of the edge away from its voxels. So no two vertices meet, every triangle has
  /// an area, and programs that merge vertices by position find the mesh closed.
  kApart,
  kExact  ///< at the isovalue itself; vertices meet on a voxel that equals it
};

struct ExtractOptions {
  std::uint32_t level = 0;   ///< level of detail; 0: the volume itself
  bool with_normals = true;  ///< computes normals, which need more blocks around the surface
  VertexPlaces vertices = VertexPlaces::kApart;
  /// Closes the mesh by flat caps in the faces of the volume's box, as if values lay below the
  /// isovalue all around it: for printing, and volumes. Not with voxels without data and kExact.
  bool closed = false;
  /// Number of parts of the mesh that are kept, those with the largest areas. 0: all. Parts hang
  /// together by common vertices. This and simplify take memory for the whole mesh.
  std::uint64_t largest = 0;
  /// About this share of the triangles is left, (0,1], by meshoptimizer; more if the error would be
  /// a tenth of the mesh. Vertices that are left stay in place, and closed meshes closed. 1: all.
  double simplify = 1;
  /// Bound on the device's memory; on the host, on value ranges and decoded blocks [bytes]. 0:
  /// three quarters of the device's memory, a quarter of the host's.
  std::uint64_t memory_budget = 0;
  /// Most decoded blocks of 4^3 voxels that a device keeps, at least 17 (without normals 8). 0: as
  /// many as the surface needs and the budget allows. The mesh does not depend on cache_blocks.
  std::uint32_t cache_blocks = 0;
  /// Called from the calling thread, before each kernel is compiled, too: what extract() is doing,
  /// and how much of it is done, 0 to 1. An exception from progress ends the extraction.
  std::function<void(std::string_view what, double done)> progress{};
};

/// Triangles that share their vertices. Each edge belongs to two triangles, except in the volume's
/// border, unless the mesh was closed, and beside voxels without data.
struct Mesh {
  /// Positions in world space; rounded if Volume::float32_positions().
  std::vector<Vector3> vertices{};
  /// A normal of each vertex, in world space, of length 1, away from larger values; empty without
  /// normals.
  std::vector<std::array<float, 3>> normals{};
  /// Numbers of vertices, counter-clockwise seen from where values are lower.
  std::vector<std::array<std::uint32_t, 3>> triangles{};
  /// About the largest distance from the mesh before it was simplified [world units].
  double simplify_error = 0;
};

/// Extracts the isosurface by marching cubes on the host, and waits for it: the mesh that a device
/// extracts (isowave/extract.hpp), bit for bit.
///
/// options  cache_blocks must be 0
/// Throws   Error: NaN, an unknown level, a budget that is too small (names one that is enough),
///          2^32 vertices and more; a mesh that cannot be closed; a share out of range, or a build
///          without meshoptimizer
Mesh extract(const std::shared_ptr<const Volume> &volume, double isovalue,
             const ExtractOptions &options = {});

/// Extracts the isosurface to a file, for surfaces larger than memory. Parts go to disk as they
/// come, in the file's folder, which holds the mesh twice for a while. The file appears whole or
/// not at all.
///
/// path     ends in .ply, .stl, .obj, .vtp, .gltf or .glb. Positions that float32 does not hold are
///          float64 in .ply, .obj and .vtp, and relative to a node's translation in glTF
/// Returns  a line for users, or nothing: what simplify did; STL has only float32, and far from the
///          origin the line and the file's header say what to add to its positions
/// Throws   Error: as above; the file cannot be written, or the format does not hold so much
std::string extract_to_file(const std::shared_ptr<const Volume> &volume, double isovalue,
                            const std::filesystem::path &path, const ExtractOptions &options = {});

/// Writes a mesh to a file.
///
/// path     as for extract_to_file()
/// Returns  as extract_to_file()
/// Throws   Error: neither no normals nor one for each vertex; triangles of unknown vertices; the
///          file cannot be written
std::string save_mesh(const Mesh &mesh, const std::filesystem::path &path);

}  // namespace isowave
