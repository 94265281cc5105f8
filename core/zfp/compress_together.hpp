#pragma once
// A team compresses a volume into one `.zfp` file: each process a slab of whole layers of blocks,
// which it writes at its place. The file has the bytes that compress_to_file() writes.

#include "core/base/team.hpp"
#include "core/volume/voxel_chunks.hpp"
#include "core/zfp/shared_file.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Compresses the volume. In memory: a few layers of voxels; if an error is bounded, the compressed
/// slab; with levels, the slab of the second level as float32, and the memory of compress_to_file()
/// for the slab's levels.
///
/// open    gives the whole volume's reader
/// options input.part is not used
/// Returns the volume that was written, with empty words, index and bounds
/// Throws  Error at all processes, as compress_to_file()
CompressedVolume compress_together(Team &team, const OpenReader &open,
                                   const CompressOptions &options, SharedFile &file);

}  // namespace isowave::core
