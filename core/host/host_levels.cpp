#include "core/host/host_levels.hpp"

#include <utility>

#include "core/view/detail.hpp"
#include "core/zfp/stated_errors.hpp"
#include "kernels_cl/portable/label_table.h"

namespace isowave::core {

std::uint64_t HostLevels::least_bytes(const CompressedVolume &volume, std::size_t num_surfaces,
                                      bool at_levels) {
  std::uint64_t sum = HostBlocks::ray_bytes();
  for (const CompressedVolume *level : levels_of(volume, true))
    sum += HostBlocks::bytes(level->info, level->chunks != nullptr);
  for (const CompressedVolume *level : levels_of(volume, at_levels))
    sum += (num_surfaces - 1) * HostBlocks::bytes_per_isovalue(level->info);
  return sum;
}

HostLevels::HostLevels(const CompressedVolume &volume, std::uint64_t memory_limit,
                       std::uint32_t num_threads)
    : volumes_(levels_of(volume, true)),
      infos_(level_infos(volume, true)),
      num_threads_(num_threads),
      room_(memory_limit, num_threads),
      blocks_(volumes_.size()) {
  blocks_of(0);
}

HostBlocks &HostLevels::blocks_of(std::size_t level) {
  std::unique_ptr<HostBlocks> &blocks = blocks_[level];
  if (!blocks) blocks = std::make_unique<HostBlocks>(*volumes_[level], room_, num_threads_);
  return *blocks;
}

std::vector<HostLevel> HostLevels::open(std::span<const FrameParams> frames, double voxel_error,
                                        FieldBound bound) {
  // Bounds need the range of values, which a file may get wrong.
  if (bound != FieldBound::kNone && volumes_[0]->errors_are_stated)
    check_value_range(*volumes_[0], finest().extremes());
  std::vector<HostLevel> levels;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!draws(frames[i])) continue;
    HostBlocks &blocks = blocks_of(i);
    blocks.decode_as(
        {*volumes_[i], i == 0, voxel_error_of(voxel_error, i), bound, volumes_[0]->value_range});
    blocks.select(frames[i].surface.isovalue);
    levels.push_back({frames[i], blocks.field()});
    levels.back().frame.surface = blocks.surface();
  }
  // If there are several bands, a ray may begin at a border that lies outside the box.
  if (levels.size() == 1) levels[0].frame.screen = make_screen_box(levels[0].frame);
  return levels;
}

std::vector<LeveledSurface> HostLevels::open_surfaces(std::span<const FrameParams> frames,
                                                      std::span<const float> isovalues,
                                                      double voxel_error) {
  std::vector<LeveledSurface> surfaces(isovalues.size());
  for (std::size_t level = 0; level < frames.size(); ++level) {
    if (!draws(frames[level])) continue;
    HostBlocks &blocks = blocks_of(level);
    blocks.decode_as({*volumes_[level], level == 0, voxel_error_of(voxel_error, level),
                      FieldBound::kNone, volumes_[0]->value_range});
    blocks.select(isovalues);
    for (std::size_t i = 0; i < isovalues.size(); ++i) {
      surfaces[i].push_back({frames[level], blocks.field(i)});
      surfaces[i].back().frame.surface = blocks.surface(i);
    }
  }
  for (LeveledSurface &surface : surfaces) {
    if (surface.size() == 1) surface[0].frame.screen = make_screen_box(surface[0].frame);
  }
  return surfaces;
}

/// The finest level, with the field of these labels.
HostBlocks &HostLevels::blocks_of_labels(std::size_t group, std::span<const std::uint16_t> labels) {
  std::vector<std::uint8_t> of_group(ISO_NUM_LABELS);
  for (const std::uint16_t label : labels) of_group[label] = 1;
  if (group == label_blocks_.size()) {
    label_blocks_.push_back(
        std::make_unique<HostBlocks>(*volumes_[0], room_, num_threads_, std::move(of_group)));
  } else {
    label_blocks_[group]->show_labels(of_group);
  }
  label_blocks_[group]->select(ISO_LABEL_ISOVALUE);
  return *label_blocks_[group];
}

std::vector<LeveledSurface> HostLevels::open_labels(
    const FrameParams &frame, std::span<const std::vector<std::uint16_t>> groups) {
  std::vector<LeveledSurface> surfaces;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    HostBlocks &blocks = blocks_of_labels(i, groups[i]);
    HostLevel &surface = surfaces.emplace_back(1, HostLevel{frame, blocks.field()}).front();
    surface.frame.surface = blocks.surface();
    surface.frame.screen = make_screen_box(surface.frame);
  }
  return surfaces;
}

std::optional<BlockBox> HostLevels::label_box(std::span<const std::uint16_t> labels) {
  const Surface &surface = blocks_of_labels(0, labels).surface();
  if (surface.active_end_x == 0) return {};
  return BlockBox{{surface.active_begin_x, surface.active_begin_y, surface.active_begin_z},
                  {surface.active_end_x, surface.active_end_y, surface.active_end_z}};
}

HostBlocks &HostLevels::open_finest(float isovalue) {
  HostBlocks &blocks = blocks_of(0);
  blocks.decode_as(HostValues(*volumes_[0]));
  blocks.select(isovalue);
  return blocks;
}

void HostLevels::forget() {
  for (const auto &blocks : blocks_) {
    if (blocks) blocks->forget();
  }
  for (const auto &blocks : label_blocks_) blocks->forget();
}

std::uint64_t HostLevels::num_decoded() const {
  std::uint64_t sum = 0;
  for (const auto &blocks : blocks_) sum += blocks ? blocks->num_decoded() : 0;
  for (const auto &blocks : label_blocks_) sum += blocks->num_decoded();
  return sum;
}

}  // namespace isowave::core
