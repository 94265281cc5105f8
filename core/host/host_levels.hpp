#pragma once
// The levels of detail of a compressed volume, for rays on the host.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/host/host_blocks.hpp"

namespace isowave::core {

/// The levels share memory. A coarser level is made when a frame first needs it.
class HostLevels {
 public:
  /// The least limit of the memory: value ranges of all levels, and room for the blocks that a
  /// single ray needs at a time.
  ///
  /// num_surfaces  most of a frame
  /// at_levels     coarser levels may draw several surfaces, too
  static std::uint64_t least_bytes(const CompressedVolume &volume, std::size_t num_surfaces = 1,
                                   bool at_levels = false);

  /// volume        must outlive this
  /// memory_limit  bound on bytes(); at least least_bytes()
  /// num_threads   0: one per processor
  /// Throws        Error: as HostBlocks
  HostLevels(const CompressedVolume &volume, std::uint64_t memory_limit, std::uint32_t num_threads);

  /// Grids of all levels, the finest first.
  const std::vector<VolumeInfo> &infos() const { return infos_; }
  const HostBlocks &finest() const { return *blocks_.front(); }
  HostBlocks &finest() { return *blocks_.front(); }

  /// Prepares the levels that draw a frame.
  ///
  /// frames       see make_level_frames()
  /// voxel_error  FrameRequest::voxel_error
  /// bound        FrameRequest::bound
  /// Returns  the drawing levels, with their surfaces; the screen box of the first is the rays'.
  /// They
  ///          stay valid until the next call of this or of HostBlocks::select()
  /// Throws   Error: as HostBlocks and value_offset(); the file contradicts itself
  std::vector<HostLevel> open(std::span<const FrameParams> frames, double voxel_error = 0,
                              FieldBound bound = FieldBound::kNone);
  /// Prepares the levels that draw a frame of several surfaces.
  ///
  /// frames       see make_level_frames()
  /// isovalues    one or more; the limit of the memory is at least least_bytes() of so many
  /// voxel_error  FrameRequest::voxel_error
  /// Returns  [isovalue] as open()
  /// Throws   Error: as HostBlocks
  std::vector<LeveledSurface> open_surfaces(std::span<const FrameParams> frames,
                                            std::span<const float> isovalues, double voxel_error);
  /// Memory of that many groups of labels, beside least_bytes().
  static std::uint64_t bytes_of_labels(const VolumeInfo &info, std::size_t num_groups) {
    return num_groups * HostBlocks::bytes(info);
  }
  /// Prepares the finest level for a frame of surfaces of labels. Groups that are not those of the
  /// frame before have all blocks decoded once each.
  ///
  /// frame   of the finest level
  /// groups  one or more lists of labels
  /// Returns  [group] as open_surfaces()
  /// Throws   Error: as HostBlocks
  std::vector<LeveledSurface> open_labels(const FrameParams &frame,
                                          std::span<const std::vector<std::uint16_t>> groups);
  /// The box around the blocks that the surface of labels is in; none if there is no such block.
  std::optional<BlockBox> label_box(std::span<const std::uint16_t> labels);
  /// Prepares the finest level for rays of any origin: its field is that of all bit planes.
  HostBlocks &open_finest(float isovalue);

  HostRoom &room() { return room_; }
  void forget();
  std::uint64_t num_decoded() const;
  /// Memory at present.
  std::uint64_t bytes() const { return room_.bytes(); }

 private:
  HostBlocks &blocks_of(std::size_t level);
  HostBlocks &blocks_of_labels(std::size_t group, std::span<const std::uint16_t> labels);

  std::vector<const CompressedVolume *> volumes_;
  std::vector<VolumeInfo> infos_;
  std::uint32_t num_threads_;
  HostRoom room_;
  std::vector<std::unique_ptr<HostBlocks>> blocks_;        ///< [level] null: not made yet
  std::vector<std::unique_ptr<HostBlocks>> label_blocks_;  ///< [group] of the finest level
};

}  // namespace isowave::core
