#pragma once
// Bricks as volumes that a renderer draws: their own blocks, and around them one layer of others'.
//
// Dual cells have voxels of the blocks behind, and smooth normals of those before, too. Where the
// whole volume ends, so does a brick. So its hits, and their normals, have the bits of the whole.

#include <memory>
#include <string>
#include <vector>

#include "core/sources/load_volume.hpp"
#include "core/volume/block_box.hpp"
#include "core/volume/volume.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Along each axis.
inline glm::ivec3 blocks_along(const VolumeInfo &info) {
  return glm::ivec3((info.dims + 3u) / 4u);
}

/// What a brick keeps of a volume of so many blocks: its own, and one layer around.
BlockBox kept_blocks(const glm::ivec3 &blocks, const BlockBox &own);

/// The grid of a brick. Rays of its frames are those of the whole volume.
///
/// whole  not a brick itself
/// own    not empty, within the whole
VolumeInfo brick_info(const VolumeInfo &whole, const BlockBox &own);

/// Blocks along an edge of the cubes that cuts may not part (Cuts), where so many levels of detail
/// are drawn: then a brick is the same box at all of them, and rays change from one level to
/// another within it.
inline int cut_unit(std::size_t num_levels) {
  return 1 << (num_levels - 1);
}

/// A brick of a volume.
///
/// num_levels  of detail, the volume itself among them; own's planes are multiples of cut_unit()
/// Throws      Error: the file that the volume is in is shorter than it was
CompressedVolume cut_brick(const CompressedVolume &whole, const BlockBox &own,
                           std::size_t num_levels = 1);

/// A brick of a `.zfp` file, of which only its blocks are read: see read_zfp_blocks().
CompressedVolume read_brick(const std::filesystem::path &path, const BlockBox &own,
                            std::size_t num_levels = 1, bool with_bounds = false);

/// A brick of any other volume, of one level of detail, compressed as the whole would be. Reads the
/// layers of voxels that the brick has part of; where an error is bounded, before that the whole
/// volume. Range of values and measured error are the brick's: see agree_on_voxels().
///
/// Throws  Error as compress_volume()
CompressedVolume compress_brick(const OpenReader &open, std::string_view what,
                                const Storage &storage, const BlockBox &own);

/// What open_compressed_volume() or open_any_volume() would give, of which only grids are there,
/// the finest level of detail first.
///
/// Throws  Error as those do, but not on what only bricks can be drawn of
std::vector<VolumeInfo> read_levels(const std::string &path, const RawOverrides &overrides);

/// A brick of such a volume, with so many levels of detail: read, or compressed.
///
/// info    of the finest level, as read_levels() has it
/// storage its device also makes generated voxels; with measure_error, bounds of a file's blocks
///         are read
/// Throws  Error also on what cannot be drawn
CompressedVolume load_brick(const std::string &path, const RawOverrides &overrides,
                            const Storage &storage, const VolumeInfo &info, std::size_t num_levels,
                            const BlockBox &own);

/// The brick's part of the values that thresholds of value ranges are made of (range_thresholds()).
/// Together, the bricks give what the whole volume would. If the whole has more blocks than there
/// are ids, each brick gives a sample of its own.
std::vector<float> range_samples(const CompressedVolume &brick, const VolumeInfo &whole);

}  // namespace isowave::core
