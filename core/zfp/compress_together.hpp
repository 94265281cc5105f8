#pragma once
// A team compresses a volume into one `.zfp` file: each process a slab of whole layers of blocks,
// which it writes at its place. The file has the bytes that compress_to_file() writes.

#include "core/base/team.hpp"
#include "core/volume/voxel_chunks.hpp"
#include "core/zfp/shared_file.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Compresses the volume. In memory: a few layers of voxels; where an error is bounded, what the
/// slab is compressed to; with levels, the slab of the second one as float32, and what
/// compress_to_file() says of them, for the slab.
///
/// open    gives the whole volume's reader
/// options input.part is not looked at
/// Returns what was written, but for words, index and bounds, which stay empty
/// Throws  Error at all processes, as compress_to_file()
CompressedVolume compress_together(Team &team, const OpenReader &open,
                                   const CompressOptions &options, SharedFile &file);

}  // namespace isowave::core
