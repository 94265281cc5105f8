#pragma once
// Isosurfaces of one compressed volume as triangle meshes: Block-Compressed Marching Cubes (Usher
// and Pascucci, LDAV 2020), with a cache of fixed size.
//
//   active blocks -> [ request -> cache -> decode -> count ]* -> prefix sums
//                 -> [ request -> cache -> decode -> write -> mesh ]*
//
// If all blocks of the surface fit the cache, each is decoded once, and stays for the next
// isovalue. Otherwise the surface is extracted in batches, each twice; no vertex depends on them.

#include <cstdint>

#include "core/extract/surface_blocks.hpp"
#include "core/mesh/mesh.hpp"
#include "core/stages/marching_cubes.hpp"

namespace isowave::core {

struct ExtractorOptions {
  bool with_normals = true;  ///< takes more blocks around the surface
  VertexPlaces vertices = VertexPlaces::kApart;
  std::uint64_t memory_budget = 0;  ///< bound on all device memory [bytes]; 0: 3/4 of the device's
  /// Decoded blocks kept at most; 0: as many as the surface needs, if the budget allows.
  std::uint32_t cache_slots = 0;
  StreamPlace stream = StreamPlace::kAuto;  ///< place of the compressed volume
  std::uint32_t part_vertices = 1u << 20;   ///< of a part of the mesh at most, but for one block's
};

/// Counts and times of an extraction.
struct ExtractStats {
  MeshSize size{};
  std::uint64_t listed_blocks = 0;   ///< whose cells the surface may pass
  std::uint64_t needed_blocks = 0;   ///< these and the neighbours that they need
  std::uint64_t decoded_blocks = 0;  ///< more than needed if the cache does not hold all
  std::uint32_t cache_slots = 0;
  std::uint32_t count_batches = 0, write_batches = 0;
  std::uint64_t device_bytes = 0;  ///< of all buffers
  double list_ms = 0, count_ms = 0, write_ms = 0;
  double total_ms = 0;  ///< wall clock, the sink's work included
};

/// Not thread-safe, as the device.
class Extractor {
 public:
  /// Uploads the volume and builds its macrocell ranges.
  ///
  /// device  must outlive the extractor
  /// volume  or a level of detail of it; must outlive the extractor, too
  /// Throws  Error: options out of range, the device's memory or the budget does not suffice
  /// Waits   yes
  Extractor(ocl::Device &device, const CompressedVolume &volume, const ExtractorOptions &options);

  /// Gives the isosurface to `sink`: triangles that share their vertices. Every edge of a triangle
  /// belongs to two, but for those at the volume's border. The same bits on every device and with
  /// every budget.
  ///
  /// Throws  Error: a NaN isovalue, a budget that is too small, more than 2^32 - 1 vertices; what
  ///         the sink throws
  /// Waits   yes
  ExtractStats extract(float isovalue, MeshSink &sink, const Progress &progress = {});

  /// Forgets all decoded blocks: for measurements. No mesh depends on it.
  void clear_cache() { blocks_.drop_cache(); }

 private:
  struct Run;
  /// How the memory that the volume leaves is shared out.
  struct Plan {
    std::uint32_t cache_slots = 0;
    std::uint64_t part_vertices = 0, part_triangles = 0;
    std::uint64_t bytes = 0;  ///< of all buffers
  };

  Plan plan_for(std::uint64_t num_listed, std::uint64_t num_needed, float isovalue) const;
  void count(Run &run);
  void write(Run &run);
  void give(Run &run, std::uint32_t begin);

  ocl::Device &device_;
  ExtractorOptions options_;
  VolumeInfo info_;
  Gradients gradients_;
  SurfaceBlocks blocks_;
  MarchingCubes marching_cubes_;
};

}  // namespace isowave::core
