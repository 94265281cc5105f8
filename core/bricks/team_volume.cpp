#include "core/bricks/team_volume.hpp"

#include <chrono>
#include <optional>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/bricks/ranks.hpp"
#include "core/volume/range_thresholds.hpp"
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

}  // namespace isowave::core
