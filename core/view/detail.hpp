#pragma once
// Level of detail: which of a volume's levels draws which part of the rays.
//
// A level is fine enough from the distance on at which its voxels are at most so many pixels apart.
// So a frame is drawn in bands, from spherical border to border, the finest level nearest. A ray
// that crosses a border goes on at the next level. If the two levels have the ray on different
// sides of the isosurface, the border is its hit, so that no ray slips between them.

#include <cmath>
#include <span>
#include <vector>

#include "core/view/frame.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

/// One frame for each level, the finest first: as make_frame_params() makes it, but with the
/// level's place and band. The first band begins at the eye, the last one has no end; a level
/// whose band the volume does not reach into has an empty one, and draws nothing. If there are
/// several bands, the active box of each is its whole domain, and the first one's screen box is for
/// all.
///
/// levels        the finest first
/// voxel_pixels  distance between a level's voxels, at most [pixels]; 0: the finest level draws all
/// Throws        Error: what make_frame_params() throws
std::vector<FrameParams> make_level_frames(std::span<const VolumeInfo> levels, const Camera &camera,
                                           ImageSize size, float isovalue, double voxel_pixels);

/// How far decoded voxels of a level may be off if those of the finest may be off by voxel_error:
/// twice as far as in the level before, since a level is drawn from twice the distance on. So
/// errors of left out planes are as many pixels wide at each border.
inline double voxel_error_of(double voxel_error, std::size_t level) {
  return std::ldexp(voxel_error, static_cast<int>(level));
}

/// The volume and, if levels are wanted, its coarser levels.
std::vector<const CompressedVolume *> levels_of(const CompressedVolume &volume, bool with_levels);
std::vector<VolumeInfo> level_infos(const CompressedVolume &volume, bool with_levels);

/// The table of kernels_cl/portable/no_data.h for the blocks of all levels, in the order of their
/// ranges (LevelPlace::ranges_begin), and how many words it has. Empty if all voxels have data, and
/// for one level: the table is for rays that cross from one to another.
std::vector<std::uint32_t> joined_no_data(std::span<const CompressedVolume *const> levels);
std::uint64_t joined_no_data_words(std::span<const CompressedVolume *const> levels);

/// Grid parameters of each level, with the places of its blocks, ranges and masks among those of
/// all levels.
std::vector<FrameParams> make_level_grids(std::span<const VolumeInfo> levels);

/// Gives a map from hits (HitMap, FieldMap) the places of the levels' blocks.
template <class Map>
void set_level_places(std::span<const VolumeInfo> levels, Map &map) {
  const std::vector<FrameParams> grids = make_level_grids(levels);
  map.blocks_x = grids.front().place.blocks_x;
  map.blocks_y = grids.front().place.blocks_y;
  map.num_levels = static_cast<uint>(grids.size());
  for (std::size_t level = 0; level < grids.size(); ++level)
    map.begin_z[level] = grids[level].place.begin_z;
}
/// All levels' ids as those of one grid: its blocks are as many along x and y as the finest
/// level's.
BlockGrid make_id_grid(std::span<const FrameParams> level_grids);

inline bool draws(const FrameParams &frame) {
  return frame.band.begin_t < frame.band.end_t;
}

/// Throws  Error: not finite, or below 0
void check_voxel_pixels(double voxel_pixels);
/// Throws  Error: a volume that could have levels of detail has none
void check_has_levels(const CompressedVolume &volume);

}  // namespace isowave::core
