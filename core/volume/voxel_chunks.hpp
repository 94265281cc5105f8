#pragma once
// A volume on its way to a compressor: it is read chunk by chunk, one chunk ahead, and every voxel
// is checked.

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include "core/base/team.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core {

/// done and total in voxel layers; called from the calling thread.
using Progress = std::function<void(std::uint32_t done, std::uint32_t total)>;

/// zfp cannot hold every float32 (its block scale is a float32 itself, and decoding overshoots by
/// up to 2x). Voxels of at least kMaxMagnitude are refused; those below kMinMagnitude become 0,
/// unless they are kept (InputOptions), so that no decoder ever meets an infinity or a denormal.
inline constexpr float kMaxMagnitude = 0x1p126f;
inline constexpr float kMinMagnitude = 0x1p-97f;

inline constexpr std::uint32_t kBlockEdge = 4;  ///< voxels

/// Opens a reader at the volume's front, each time it is called.
using OpenReader = std::function<std::unique_ptr<VolumeReader>()>;

/// A part of a volume that processes read together. If several processes have a layer, one counts
/// it.
struct VolumePart {
  Team *team = nullptr;
  VolumeInfo whole{};
  std::uint32_t begin = 0;  ///< layer of the whole that this process's reader begins with
  std::uint32_t own_begin = 0, own_end = 0;  ///< layers of the whole that it counts; may be none
};

/// How a volume is read for compression.
struct InputOptions {
  /// Replaces NaN and +-Inf. Unset: voxels that are NaN have no data, infinite ones are refused
  /// with count and first position.
  std::optional<float> map_nan{};
  /// Voxels of this value have no data: a number of the source's type, or infinite. It is compared
  /// with values as readers give them, rounded to float32 for a float32 volume.
  std::optional<double> no_data{};
  Progress progress{};
  std::uint32_t num_threads = 0;  ///< 0: one per processor; the result is the same for any number
  /// The part that the reader gives. All processes find, and refuse, the same as in the whole.
  const VolumePart *part = nullptr;
  bool keeps_tiny = false;  ///< voxels below kMinMagnitude are coded as they are
};

/// A few voxel layers: whole layers of blocks, except at the volume's end.
struct Chunk {
  std::uint32_t z = 0, num_layers = 0;
  std::span<float> voxels{};   ///< [num_layers][ny][nx]
  std::uint64_t num_rows = 0;  ///< of blocks along x
  /// [num_rows][blocks along x]: how far a block's voxels are from the source's at most, since
  /// float32 cannot hold those or they were tiny and became 0. The source of a mapped NaN is what
  /// it was mapped to. Complete at end_chunk().
  std::span<float> lost{};
  /// [num_rows][blocks along x]: bit x + 4y + 16z of a block: the voxel has no data; all bits of a
  /// block without any. `voxels` has what continues the block's others smoothly there, or 0.
  /// Complete at end_chunk().
  std::span<std::uint64_t> no_data{};
};

/// Layers of the chunks that a volume is cut into, but for its last.
std::uint32_t layers_per_chunk(const glm::uvec3 &dims);
/// The chunk of these layers of a volume, the first of which is z.
Chunk make_chunk(const glm::uvec3 &dims, std::uint32_t z, std::span<float> voxels);

/// A row of blocks along x within a chunk.
struct BlockRow {
  std::uint64_t index = 0;  ///< in its chunk, in the order of blocks
  const float *voxels =
      nullptr;  ///< its first; a voxel row is nx values, a layer nx * ny of the volume
  std::uint32_t ny = 0, nz = 0;            ///< voxel rows and layers that it has, 1..4
  const float *lost = nullptr;             ///< of its blocks: Chunk::lost
  const std::uint64_t *no_data = nullptr;  ///< of its blocks: Chunk::no_data
};

/// Takes the checked voxels, chunk by chunk.
class ChunkCoder {
 public:
  virtual ~ChunkCoder() = default;
  virtual void begin_chunk(const Chunk &) {}
  /// Called for every row of the chunk, from several threads; thread: as parallel_for()'s. Its
  /// voxels are checked.
  virtual void code_row(const BlockRow &, std::uint32_t /*thread*/) {}
  /// Not called once a voxel was refused.
  virtual void end_chunk(const Chunk &) {}
};

/// Codes one chunk of voxels that were made here: checked as those of a file are, but none can be
/// refused.
void code_chunk(Chunk chunk, const glm::uvec3 &dims, const InputOptions &options,
                ChunkCoder &coder);

/// [min, max] of a volume's voxels with data, after map_nan; 0 and 0 if there are none.
struct ValueRange {
  std::array<float, 2> coded{};    ///< as float32, tiny ones before they become 0
  std::array<double, 2> source{};  ///< as the source has them
};
/// Reads the volume from front to back for `coder`. If the reader has a part of a volume, all
/// processes make the same call.
///
/// Throws  Error: voxels that cannot be compressed, after all of them were looked at; a bad grid;
///         an unfit map_nan or no_data
ValueRange read_in_chunks(VolumeReader &reader, const InputOptions &options, ChunkCoder &coder);

}  // namespace isowave::core
