#pragma once
// Isosurfaces of a compressed volume as triangle meshes, without OpenCL: the bits of an Extractor's
// (core/extract/extractor.hpp), in the same order.
//
//   value ranges -> blocks that the isovalue crosses -> [ decode -> count ] -> sums
//                -> [ decode -> write -> part of the mesh ]*

#include <cstdint>

#include "core/mesh/mesh.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

struct HostExtractorOptions {
  bool with_normals = true;  ///< takes more blocks around the surface
  VertexPlaces vertices = VertexPlaces::kApart;
  /// Bytes of value ranges and decoded blocks; 0: a quarter of the host's memory. The mesh does not
  /// depend on it. Blocks that do not fit are decoded anew.
  std::uint64_t memory_limit = 0;
  std::uint32_t num_threads = 0;           ///< 0: one per processor
  std::uint32_t part_vertices = 1u << 20;  ///< most vertices of a part, unless one block has more
};

/// Whether the limit suffices for a volume, as extract_on_host() needs it.
///
/// memory_limit  as HostExtractorOptions::memory_limit
bool fits_host_extractor(const VolumeInfo &info, std::uint64_t memory_limit);

struct HostExtractStats {
  std::uint64_t listed_blocks = 0;   ///< whose cells the surface may pass
  std::uint64_t decoded_blocks = 0;  ///< more than needed if memory_limit does not hold all
  std::uint64_t memory_bytes = 0;    ///< value ranges and decoded blocks
  double total_ms = 0;               ///< wall clock, the sink's work included
};

/// Gives the isosurface of a volume, or of a level of detail of it, to `sink`: triangles that share
/// their vertices. Reads the whole volume for its value ranges.
///
/// Throws  Error: a NaN isovalue, a limit that is too small, more than 2^32 - 1 vertices, a file
///         that cannot be read; what the sink throws
HostExtractStats extract_on_host(const CompressedVolume &volume, float isovalue,
                                 const HostExtractorOptions &options, MeshSink &sink,
                                 const Progress &progress = {});

}  // namespace isowave::core
