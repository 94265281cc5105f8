#pragma once
// Compresses a volume and its levels of detail, chunk by chunk.

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/volume/pyramid.hpp"
#include "core/volume/voxel_chunks.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// A volume of that grid and its coarser levels, as they will be compressed: all but what the
/// voxels decide.
///
/// Throws  Error: bad rate, a bad grid, more levels than it can have
CompressedVolume describe_compressed(const VolumeInfo &info, const CompressOptions &options);
/// How voxels are read.
InputOptions input_of(const CompressOptions &options);
/// How voxels of coarser levels are checked: NaN has no data, and no other value has none.
InputOptions input_of_coarser(const CompressOptions &options);

/// Compresses the voxels of a level.
class LevelCoder : public ChunkCoder {
 public:
  /// After the last chunk: hands over what is left, and completes `volume`. Returns the errors of
  /// blocks that were to be kept, if they were measured.
  virtual std::vector<float> finish(CompressedVolume &volume) = 0;
  /// Compresses all voxels in place of chunks, where a device makes them. Returns their least and
  /// greatest; none if this coder cannot, and has done nothing.
  virtual std::optional<std::array<float, 2>> code_made(DeviceVoxels & /*voxels*/) { return {}; }
  /// The last chunk's voxels as they are decoded, if errors are measured.
  virtual std::span<const float> decoded() const = 0;
};

/// Compresses a level, and makes the voxels of the next from its own.
class PyramidCoder : public ChunkCoder {
 public:
  /// Takes layers of the next level, in order, before they are checked.
  using NextLevel = std::function<void(const Chunk &)>;

  /// volumes, sinks  of this level and all coarser ones; like options, must outlive this. The host
  ///                 compresses the coarser ones, a seventh of all, since their decoded voxels are
  ///                 needed
  /// is_finest       this level is the volume itself
  /// keep_errors     keeps the errors of each block, if they are measured
  PyramidCoder(const CompressOptions &options, std::span<CompressedVolume *const> volumes,
               std::span<const PayloadSink> sinks, bool is_finest, bool keep_errors,
               NextLevel next_level = {});
  void begin_chunk(const Chunk &chunk) override { coder_->begin_chunk(chunk); }
  void code_row(const BlockRow &row, std::uint32_t thread) override {
    coder_->code_row(row, thread);
  }
  void end_chunk(const Chunk &chunk) override;
  /// As LevelCoder::code_made(). None if coarser levels need the voxels.
  std::optional<std::array<float, 2>> code_made(DeviceVoxels &voxels) {
    return next_ ? std::nullopt : coder_->code_made(voxels);
  }

  /// After the last chunk: completes all volumes.
  ///
  /// off  how far this level's blocks are from the source; of the finest, none
  void finish(const LevelBounds::Off &off = {});

  // The steps of finish(), for callers that put parts of volumes together: each once, in this
  // order.

  /// Completes this level's volume but for its bounds. Returns the errors that were to be kept.
  std::vector<float> finish_level() {
    volume_.no_data = no_data_.finish();
    return coder_->finish(volume_);
  }
  /// How far the next level's blocks are from the source; made: the same of this one's, as they
  /// were made.
  LevelBounds::Off finish_bounds(std::span<const float> made);

 private:
  /// Takes no memory as long as nothing was lost.
  void keep_lost(std::span<const float> lost);

  CompressedVolume &volume_;
  bool is_finest_;
  NoDataBuilder no_data_;
  std::unique_ptr<LevelCoder> coder_;
  std::unique_ptr<PyramidCoder> next_;
  std::optional<Downsampler> downsampler_;
  std::optional<LevelBounds> bounds_;  ///< of the next level
  std::vector<float> lost_;     ///< of the finest level's blocks (Chunk::lost); empty: nothing
  std::size_t num_blocks_ = 0;  ///< that lost_ is known of
};

}  // namespace isowave::core
