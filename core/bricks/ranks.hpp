#pragma once
// The facts that the processes of a team exchange before they draw bricks.

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/team.hpp"
#include "core/bricks/cuts.hpp"
#include "core/ocl/device.hpp"
#include "core/volume/volume.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// The device of process number local_rank of a host.
///
/// selector  for ocl::choose_device(). Several, with commas: processes take them in turn. One: the
///           processes share the devices of that device's kind.
/// Throws    Error: no such device
ocl::DeviceInfo choose_local_device(const std::string &selector, std::uint32_t local_rank);

/// A text that tells a volume from another one of the same name: its grid, its file's length, and a
/// checksum of both ends, one of which holds a `.zfp` file's checksum of the rest.
///
/// Throws  Error: the file cannot be read
std::string fingerprint(const std::string &path, const VolumeInfo &info);

/// How many of a volume's levels of detail, from the finest on, can be cut into so many bricks at
/// the same planes.
std::size_t num_cut_levels(const VolumeInfo &whole, std::size_t num_levels, std::uint32_t bricks);

/// A brick for each rank. bricks: XxYxZ, or empty; unit: see Cuts. Throws Error.
Cuts cut_for(const Team &team, const VolumeInfo &whole, const std::string &bricks, int unit);

/// A brick for each rank, with about the same number of surface blocks. load: gives a brick of
/// those blocks.
///
/// Throws  Error at every rank: fewer layers of cubes than ranks, or what load() throws
Cuts cut_by_surfaces(Team &team, const VolumeInfo &whole, std::span<const float> isovalues,
                     int unit, const std::function<CompressedVolume(const BlockBox &)> &load);

/// Gives each rank's brick the range of values and the measured error of the whole volume. A brick
/// that was compressed here does not know them.
///
/// Returns  bits per voxel of the whole (CompressedVolume::rate())
double agree_on_voxels(Team &team, CompressedVolume &brick);

/// The box, in the whole volume, around all ranks' boxes.
///
/// brick  the grid of this rank's brick
/// own    this rank's box in its brick; none: it has no box
std::optional<BlockBox> gather_box(Team &team, const VolumeInfo &brick,
                                   const std::optional<BlockBox> &own);

}  // namespace isowave::core
