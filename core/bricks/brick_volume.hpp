#pragma once
// Bricks as volumes that a renderer draws: their own blocks, and one layer of other bricks' blocks
// around them.
//
// Dual cells have voxels of the blocks behind, and smooth normals need those before, too. So a
// brick's hits and their normals have the bits of the whole. The layer ends at the whole's border.

#include <memory>
#include <string>
#include <vector>

#include "core/sources/load_volume.hpp"
#include "core/volume/block_box.hpp"
#include "core/volume/volume.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// Number of blocks along each axis.
inline glm::ivec3 blocks_along(const VolumeInfo &info) {
  return glm::ivec3((info.dims + 3u) / 4u);
}

/// The blocks of a volume that a brick keeps: its own, and one layer around. blocks: the volume's.
BlockBox kept_blocks(const glm::ivec3 &blocks, const BlockBox &own);

/// The grid of a brick. Rays of its frames are those of the whole volume.
///
/// whole  not a brick itself
/// own    not empty, within the whole
VolumeInfo brick_info(const VolumeInfo &whole, const BlockBox &own);

/// Edge of the cubes that cuts keep whole (Cuts), if num_levels levels of detail are drawn
/// [blocks]. A brick is then the same box at all levels, and rays change level within a brick.
inline int cut_unit(std::size_t num_levels) {
  return 1 << (num_levels - 1);
}

/// A brick of a volume.
///
/// own         its planes are multiples of cut_unit()
/// num_levels  levels of detail, with the volume itself
/// Throws      Error: the file that the volume is in is shorter than it was
CompressedVolume cut_brick(const CompressedVolume &whole, const BlockBox &own,
                           std::size_t num_levels = 1);

/// A brick of a `.zfp` file. Reads only the brick's blocks: see read_zfp_blocks().
CompressedVolume read_brick(const std::filesystem::path &path, const BlockBox &own,
                            std::size_t num_levels = 1, bool with_bounds = false);

/// A brick of any other volume, of one level of detail, compressed as the whole would be. Reads the
/// layers of voxels that the brick has a part of; if an error is bounded, it reads the whole volume
/// before. Range of values and measured error are the brick's: see agree_on_voxels().
///
/// Throws  Error as compress_volume()
CompressedVolume compress_brick(const OpenReader &open, std::string_view what,
                                const Storage &storage, const BlockBox &own);

/// The grids of a volume's levels of detail, the finest first, without its voxels.
///
/// Throws  Error as open_compressed_volume() and open_any_volume(), but not if only bricks of the
///         volume can be drawn
std::vector<VolumeInfo> read_levels(const std::string &path, const RawOverrides &overrides);

/// Reads or compresses a brick of a volume of any kind, with its levels of detail.
///
/// info    the finest level's, from read_levels()
/// storage its device also makes generated voxels; with measure_error, bounds of a file's blocks
///         are read
/// Throws  Error also if the brick cannot be drawn
CompressedVolume load_brick(const std::string &path, const RawOverrides &overrides,
                            const Storage &storage, const VolumeInfo &info, std::size_t num_levels,
                            const BlockBox &own);

/// The brick's part of the values that thresholds of value ranges are made of (range_thresholds()).
/// Together, the bricks give what the whole volume would. If the whole has more blocks than there
/// are ids, each brick gives a sample of its own.
std::vector<float> range_samples(const CompressedVolume &brick, const VolumeInfo &whole);

}  // namespace isowave::core
