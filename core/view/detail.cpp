#include "core/view/detail.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_access.hpp>
#include <limits>

#include "core/base/error.hpp"
#include "core/volume/pyramid.hpp"

namespace isowave::core {

namespace {

/// Distances from the eye: none to a point of the volume's domain is less than the first or more
/// than the second, a little apart so that no rounding matters [world units].
std::array<double, 2> reach(const VolumeInfo &info, const glm::dvec3 &eye) {
  const glm::dmat3 to_world = info.index_to_world(), to_index = glm::inverse(to_world);
  const glm::dvec3 last = glm::dvec3(info.dims) - 1.0,
                   at = to_index * (eye - info.origin) - glm::dvec3(info.brick.first_voxel);
  double farthest = 0, radius = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 side(corner & 1, corner >> 1 & 1, corner >> 2);
    farthest = std::max(farthest, glm::length(to_world * (last * side - at)));
    radius = std::max(radius, glm::length(to_world * (last * (side - 0.5))));
  }
  double nearest = glm::length(to_world * (0.5 * last - at)) - radius;  // to a ball around it
  for (int axis = 0; axis < 3; ++axis) {  // and to the planes of its faces
    const double beyond = std::max(-at[axis], at[axis] - last[axis]);
    nearest = std::max(nearest, beyond / glm::length(glm::row(to_index, axis)));
  }
  return {0.999 * std::max(0.0, nearest), 1.001 * farthest};
}

/// Lets each level's ids, ranges and masks begin where those of the one before end.
void place_levels(std::span<FrameParams> frames) {
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const FrameParams &finer = frames[i - 1];
    FrameParams &frame = frames[i];
    frame.place = {
        .blocks_x = finer.place.blocks_x,
        .blocks_y = finer.place.blocks_y,
        .begin_z = finer.place.begin_z + finer.grid.blocks_z,
        .ranges_begin = finer.place.ranges_begin + static_cast<uint>(block_count(finer.grid)),
        .masks_begin = finer.place.masks_begin + 2 * static_cast<uint>(num_macrocells(finer.grid))};
  }
}

ScreenBox around(const ScreenBox &a, const ScreenBox &b) {
  return {std::min(a.begin_x, b.begin_x), std::min(a.begin_y, b.begin_y),
          std::max(a.end_x, b.end_x), std::max(a.end_y, b.end_y)};
}

}  // namespace

std::vector<const CompressedVolume *> levels_of(const CompressedVolume &volume, bool with_levels) {
  std::vector<const CompressedVolume *> levels = {&volume};
  for (std::size_t i = 0; with_levels && i < volume.coarser_levels.size(); ++i)
    levels.push_back(&volume.coarser_levels[i]);
  return levels;
}

std::vector<VolumeInfo> level_infos(const CompressedVolume &volume, bool with_levels) {
  std::vector<VolumeInfo> infos;
  for (const CompressedVolume *level : levels_of(volume, with_levels)) infos.push_back(level->info);
  return infos;
}

std::vector<std::uint32_t> joined_no_data(std::span<const CompressedVolume *const> levels) {
  if (levels.size() == 1) return {};
  NoDataBuilder joined;
  for (const CompressedVolume *level : levels) {
    for (std::uint64_t block = 0; block < level->block_count(); ++block)
      joined.add(level->no_data.mask(block));
  }
  const NoData all = joined.finish();
  return {all.table().begin(), all.table().end()};
}

std::uint64_t joined_no_data_words(std::span<const CompressedVolume *const> levels) {
  std::uint64_t blocks = 0, words = 0;
  bool all_have_data = true;
  for (const CompressedVolume *level : levels) {
    blocks += level->block_count();
    const std::span<const std::uint32_t> table = level->no_data.table();
    if (table.empty()) continue;
    words += no_data_masks(table, level->block_count()).size();
    all_have_data = false;
  }
  return levels.size() == 1 || all_have_data ? 0 : no_data_masks_begin(blocks) + words;
}

std::vector<FrameParams> make_level_grids(std::span<const VolumeInfo> levels) {
  std::vector<FrameParams> grids;
  for (const VolumeInfo &info : levels) grids.push_back(make_grid_params(info));
  place_levels(grids);
  return grids;
}

BlockGrid make_id_grid(std::span<const FrameParams> level_grids) {
  BlockGrid grid = level_grids.front().grid;
  grid.blocks_z = level_grids.back().place.begin_z + level_grids.back().grid.blocks_z;
  return grid;
}

void check_voxel_pixels(double voxel_pixels) {
  if (!(voxel_pixels >= 0) || !std::isfinite(voxel_pixels))
    throw Error("a distance of {} pixels between voxels cannot be allowed: give 0 or more",
                voxel_pixels);
}

void check_has_levels(const CompressedVolume &volume) {
  if (!volume.coarser_levels.empty() || max_levels(volume.info.dims) == 1) return;
  throw Error("the volume has no levels of detail: compress it with levels");
}

std::vector<FrameParams> make_level_frames(std::span<const VolumeInfo> levels, const Camera &camera,
                                           ImageSize size, float isovalue, double voxel_pixels) {
  check_voxel_pixels(voxel_pixels);
  std::vector<FrameParams> frames;
  for (const VolumeInfo &info : levels)
    frames.push_back(make_frame_params(info, camera, size, isovalue));
  place_levels(frames);
  for (std::size_t i = 1; i < frames.size(); ++i) frames[i].band = {};
  if (voxel_pixels == 0 || levels.size() == 1) return frames;

  const VolumeInfo &finest = levels[0];
  const glm::dmat3 to_world = finest.index_to_world();
  const double voxel =
      std::max({glm::length(to_world[0]), glm::length(to_world[1]), glm::length(to_world[2])});
  const double pixel = pixel_size_at(camera, size.height, 1);
  const auto [nearest, farthest] = reach(levels.back(), camera.eye);
  // Levels' t differ by powers of two, so that their borders are the same in all bits.
  // Parallel rays see one level at all distances.
  const auto border = [&](std::size_t level, const FrameParams &frame) {
    double t = std::ldexp(voxel, static_cast<int>(level)) / (voxel_pixels * pixel);
    if (camera.parallel_height) t = t <= 1 ? 0 : std::numeric_limits<double>::infinity();
    return static_cast<float>(t / frames[0].view.t_scale) *
           (frames[0].view.t_scale / frame.view.t_scale);
  };
  const auto world_border = [&](std::size_t level) {
    return double{border(level, frames[0])} * double{frames[0].view.t_scale};
  };
  std::size_t first = 0, last = levels.size() - 1;
  while (first + 1 < levels.size() && world_border(first + 1) <= nearest) ++first;
  while (last > first && world_border(last) >= farthest) --last;
  frames[0].band = {};
  for (std::size_t level = first; level <= last; ++level) {
    FrameParams &frame = frames[level];
    frame.band = {
        .begin_t = level == first ? 0.0f : border(level, frame),
        .end_t = level == last ? std::numeric_limits<float>::infinity() : border(level + 1, frame)};
    frames[first].screen = around(frames[first].screen, frame.screen);
  }
  return frames;
}

}  // namespace isowave::core
