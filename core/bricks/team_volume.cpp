#include "core/bricks/team_volume.hpp"

#include <chrono>
#include <limits>
#include <optional>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/volume/range_thresholds.hpp"
#include "core/volume/voxel_chunks.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave::core {

namespace {

Cuts cut(Team &team, const TeamVolumeSource &source, const VolumeInfo &whole, int unit) {
  if (source.bricks != "active") return cut_for(team, whole, source.bricks, unit);
  Storage storage = source.storage;
  storage.measure_error = false;
  return cut_by_surfaces(team, whole, source.isovalues, unit, [&](const BlockBox &box) {
    return load_brick(source.path, source.overrides, storage, whole, 1, box);
  });
}

}  // namespace

TeamVolume open_together(Team &team, const TeamVolumeSource &source,
                         const std::function<void(std::vector<VolumeInfo> &levels)> &look_at) {
  std::vector<VolumeInfo> levels;
  std::string print;
  together(team, [&] {
    levels = read_levels(source.path, source.overrides);
    print = fingerprint(source.path, levels.front());
  });
  agree_on(team, "volume", print);
  together(team, [&] { look_at(levels); });
  const VolumeInfo &whole = levels.front();
  const std::size_t num_levels = num_cut_levels(whole, levels.size(), team.size());
  Cuts cuts = cut(team, source, whole, cut_unit(num_levels));
  CompressedVolume brick;
  std::vector<float> samples;
  double load_ms = 0;
  together(team, [&] {
    const auto begin = std::chrono::steady_clock::now();
    brick = load_brick(source.path, source.overrides, source.storage, whole, num_levels,
                       cuts.bricks()[team.rank()]);
    load_ms = ms_since(begin);
    samples = range_samples(brick, whole);
  });
  std::vector<float> thresholds = range_thresholds(gather(team, samples));
  const double rate = agree_on_voxels(team, brick);
  const std::string notice = all_zero_notice(brick);  // of the whole, so alike at all ranks
  if (!is_zfp_name(source.path) && !notice.empty()) throw Error("{}: {}", source.path, notice);
  return {std::move(levels),     num_levels, std::move(cuts), std::move(brick),
          std::move(thresholds), rate,       load_ms};
}

BlockBox field_blocks(const VolumeInfo &whole, const BlockBox &own, const VolumeInfo &field) {
  const glm::dmat3 to_field = glm::inverse(field.index_to_world()),
                   to_world = whole.index_to_world();
  const glm::dvec3 begin(4 * own.begin),
      end(glm::min(4u * glm::uvec3(own.end), whole.dims - 1u));  // cells reach into the next block
  glm::dvec3 least(std::numeric_limits<double>::infinity()), most = -least;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 at(corner & 1 ? end.x : begin.x, corner & 2 ? end.y : begin.y,
                        corner & 4 ? end.z : begin.z);
    const glm::dvec3 in_field = to_field * (whole.origin - field.origin + to_world * at);
    least = glm::min(least, in_field);
    most = glm::max(most, in_field);
  }
  // A voxel more on each side: kernels find a hit's place in float32.
  const glm::dvec3 blocks(blocks_along(field));
  BlockBox box{glm::ivec3(glm::clamp(glm::floor((least - 1.0) / 4.0), glm::dvec3(0), blocks - 1.0)),
               glm::ivec3(glm::clamp(glm::floor((most + 1.0) / 4.0) + 1.0, glm::dvec3(1), blocks))};
  box.end = glm::max(box.end, box.begin + 1);
  return box;
}

CompressedVolume open_field_together(Team &team, const TeamVolumeSource &source,
                                     const TeamVolume &volume) {
  const std::string &path = source.path;
  VolumeInfo whole;
  std::string print;
  std::vector<float> range;
  together(team, [&] {
    whole = read_levels(path, source.overrides).front();
    print = fingerprint(path, whole);
    if (team.rank() != 0 || is_zfp_name(path)) return;
    const Storage &storage = source.storage;
    ChunkCoder looks_on;
    const auto found =
        read_in_chunks(*open_any_volume(path, source.overrides, storage.noise),
                       {storage.map_nan, storage.no_data, {}, storage.num_threads}, looks_on);
    range.assign(found.coded.begin(), found.coded.end());
  });
  agree_on(team, "field", print);
  range = of_first(team, range);
  CompressedVolume field;
  together(team, [&] {
    const BlockBox own = field_blocks(volume.whole(), volume.cuts.bricks()[team.rank()], whole);
    field = load_brick(path, source.overrides, source.storage, whole, 1, own);
  });
  if (!range.empty()) field.value_range = {range[0], range[1]};
  return field;
}

}  // namespace isowave::core
