#pragma once
// Isosurfaces as triangle meshes, in memory or in files.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "isowave/device.hpp"
#include "isowave/volume.hpp"

namespace isowave {

struct ExtractOptions {
  std::uint32_t level = 0;          ///< of detail; 0: the volume itself
  bool with_normals = true;         ///< needs more blocks around the surface
  std::uint64_t memory_budget = 0;  ///< of device memory [bytes]; 0: three quarters of it
  /// Decoded blocks of 4^3 voxels that are kept at most, 17 and more (without normals 8); 0: as
  /// many as the surface needs and the budget allows. The mesh does not depend on it.
  std::uint32_t cache_blocks = 0;
  /// Called from the calling thread: what is done, and how much of it, 0 to 1; before each kernel is
  /// compiled, too. What it throws ends the extraction.
  std::function<void(std::string_view what, double done)> progress{};
};

/// Triangles that share their vertices. Each edge of a triangle belongs to another one, too, but
/// for those in the volume's border.
struct Mesh {
  std::vector<std::array<float, 3>> vertices{};  ///< world space
  /// Of vertices: length 1, away from larger values, world space; empty without normals.
  std::vector<std::array<float, 3>> normals{};
  /// Numbers of vertices, counter-clockwise seen from where values are lower.
  std::vector<std::array<std::uint32_t, 3>> triangles{};
};

/// Extracts the isosurface by marching cubes on the device, and waits for it. The bits of the mesh
/// are the same on every device that divides exactly.
///
/// Throws  Error: NaN, a level that there is not, a budget that does not suffice (names what
/// would),
///         2^32 vertices and more
Mesh extract(const std::shared_ptr<Device> &device, const std::shared_ptr<const Volume> &volume,
             float isovalue, const ExtractOptions &options = {});

/// The same to a file, for surfaces larger than memory: parts go to disk as they come, in the
/// file's folder, which holds the mesh twice for a while. The file appears whole or not at all.
///
/// path    ends in .ply, .stl, .obj, .vtp, .gltf or .glb
/// Throws  Error: as above; the file cannot be written, or the format does not hold so much
void extract_to_file(const std::shared_ptr<Device> &device,
                     const std::shared_ptr<const Volume> &volume, float isovalue,
                     const std::filesystem::path &path, const ExtractOptions &options = {});

/// Writes a mesh to such a file.
///
/// Throws  Error: as many normals as vertices, or none, are needed; triangles of vertices that
/// there
///         are not; the file cannot be written
void save_mesh(const Mesh &mesh, const std::filesystem::path &path);

}  // namespace isowave
