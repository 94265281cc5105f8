#pragma once
// How a team opens a volume that it draws in bricks. The steps that wait for other ranks are in one
// place, in one order: ranks that took them in different orders would wait forever.

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "core/base/team.hpp"
#include "core/bricks/cuts.hpp"
#include "core/sources/load_volume.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The volume to open, and how to cut it. All ranks give the same, except what makes and encodes
/// voxels.
struct TeamVolumeSource {
  std::string path{};
  RawOverrides overrides{};
  Storage storage{};  ///< how it is compressed, if it is not yet; by this rank's device
  /// XxYxZ bricks along each axis; "active": bricks with the same number of surface blocks; empty:
  /// bricks of equal size.
  std::string bricks{};
  std::vector<float> isovalues{};  ///< the surfaces that "active" counts
};

/// A volume that a team has cut into bricks, and this rank's brick.
struct TeamVolume {
  std::vector<VolumeInfo> levels;       ///< grids of the whole's levels, the finest first
  std::size_t num_levels = 1;           ///< number of these that bricks have
  Cuts cuts;                            ///< a brick for each rank
  CompressedVolume brick;               ///< this rank's; ranges and errors are those of the whole
  std::vector<float> range_thresholds;  ///< RendererOptions::range_thresholds, of the whole
  double rate = 0;                      ///< bits per voxel of the whole (CompressedVolume::rate())
  double load_ms = 0;                   ///< wall clock of reading, or compressing, the brick

  const VolumeInfo &whole() const { return levels.front(); }
};

/// Opens a volume: reads its grids, agrees that all ranks have the same file, cuts it, and loads
/// this rank's brick.
///
/// look_at  called with the grids of all levels before anything is loaded: it may cut off coarse
///          levels that frames do without, and throw
/// Throws   Error at every rank, if one of them fails
/// Waits    for all ranks
TeamVolume open_together(Team &team, const TeamVolumeSource &source,
                         const std::function<void(std::vector<VolumeInfo> &levels)> &look_at);

/// The blocks of a field that hits of a brick may have values of.
///
/// whole  the volume of the brick
/// own    the brick's blocks
/// field  the field's grid
/// Returns  at least one block of the field, also if the brick is outside
BlockBox field_blocks(const VolumeInfo &whole, const BlockBox &own, const VolumeInfo &field);

/// Opens a second volume, the field of a team's volume (RendererOptions::field). Each rank keeps
/// what its brick needs.
///
/// source   all but `bricks` and `isovalues`
/// Returns  this rank's part; its range of values is that of the whole field
/// Throws   Error at every rank, if one of them fails
/// Waits    for all ranks
CompressedVolume open_field_together(Team &team, const TeamVolumeSource &source,
                                     const TeamVolume &volume);

}  // namespace isowave::core
