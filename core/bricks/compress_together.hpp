#pragma once
// A team compresses a volume into one `.zfp` file: each process a slab of whole layers of blocks,
// which it writes at its place. The file has the bytes that compress_to_file() writes.

#include <cstdint>
#include <memory>
#include <span>

#include "core/base/team.hpp"
#include "core/sources/load_volume.hpp"
#include "core/volume/voxel_chunks.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// A file that all processes of a team write.
class SharedFile {
 public:
  /// Without commit(), nothing is left behind.
  virtual ~SharedFile() = default;
  /// Throws  Error: disk full and such
  virtual void write(std::uint64_t offset, std::span<const std::byte> bytes) = 0;
  /// All processes: gives the file its name.
  ///
  /// Throws  Error at all of them
  virtual void commit() = 0;
};

/// This process's share of the volume's layers of blocks, for InputOptions; none, where there are
/// fewer than processes.
VolumePart own_part(Team &team, const VolumeInfo &whole);

/// A reader of so many layers from part.begin on. All processes make the same call.
///
/// open    gives the whole volume's
/// Throws  Error at all of them
std::unique_ptr<VolumeReader> open_part(const VolumePart &part, std::uint32_t num_layers,
                                        const OpenReader &open);

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
