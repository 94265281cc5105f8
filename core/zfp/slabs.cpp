#include "core/zfp/slabs.hpp"

#include <algorithm>
#include <utility>

namespace isowave::core {

namespace {

/// Some layers of a reader's.
class LayersReader : public VolumeReader {
 public:
  LayersReader(std::unique_ptr<VolumeReader> whole, const LayerRange &layers)
      : whole_(std::move(whole)), begin_(layers.begin) {
    info_ = whole_->info();
    info_.dims.z = layers.count();
  }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    whole_->read_layers(begin_ + z_begin, num_layers, out);
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override {
    whole_->read_exact_layers(begin_ + z_begin, num_layers, out);
  }

 private:
  std::unique_ptr<VolumeReader> whole_;
  std::uint32_t begin_;
};

std::vector<LayerRange> share_out(std::uint32_t layers, std::uint32_t size) {
  std::vector<LayerRange> shares;
  for (std::uint64_t rank = 0; rank < size; ++rank) {
    shares.push_back({static_cast<std::uint32_t>(layers * rank / size),
                      static_cast<std::uint32_t>(layers * (rank + 1) / size)});
  }
  return shares;
}

}  // namespace

LayerRange common_layers(const LayerRange &a, const LayerRange &b) {
  const std::uint32_t begin = std::max(a.begin, b.begin);
  return {begin, std::max(begin, std::min(a.end, b.end))};
}

std::uint32_t num_block_layers(const VolumeInfo &info) {
  return (info.dims.z + 3) / 4;
}

LayerRange voxel_layers(const VolumeInfo &info, const LayerRange &blocks) {
  return {std::min(4 * blocks.begin, info.dims.z), std::min(4 * blocks.end, info.dims.z)};
}

/// A block of the next level belongs to the rank of its first fine block, or of the first behind
/// that. The rank must know, as the whole volume would give them, the blocks before and behind it,
/// whose voxels are decoded, and the layers of this level's voxels that those are made of.
std::vector<LevelCuts> cut_levels(std::span<const VolumeInfo> levels, std::uint32_t size) {
  constexpr std::uint32_t kAround = 4;
  std::vector<LevelCuts> cuts = {{share_out(num_block_layers(levels[0]), size), {}}};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const std::uint32_t total = num_block_layers(levels[i]);
    if (i + 1 == levels.size()) {
      cuts[i].worked = cuts[i].own;
      break;
    }
    const std::uint32_t next_total = num_block_layers(levels[i + 1]);
    const auto half = [&](std::uint32_t b) { return b == total ? next_total : (b + 1) / 2; };
    LevelCuts next;
    for (const LayerRange &own : cuts[i].own) {
      const LayerRange coarse = {half(own.begin), half(own.end)};
      next.own.push_back(coarse);
      LayerRange worked = own;
      if (!coarse.empty()) {
        worked.begin = 2 * coarse.begin - std::min(2 * coarse.begin, kAround);
        worked.end = std::min(total, std::max(own.end, 2 * coarse.end + kAround));
      }
      cuts[i].worked.push_back(worked);
    }
    cuts.push_back(std::move(next));
  }
  return cuts;
}
VolumePart own_part(Team &team, const VolumeInfo &whole) {
  const LayerRange own =
      voxel_layers(whole, share_out(num_block_layers(whole), team.size())[team.rank()]);
  return {&team, whole, own.begin, own.begin, own.end};
}

std::unique_ptr<VolumeReader> open_part(const VolumePart &part, std::uint32_t num_layers,
                                        const OpenReader &open) {
  std::unique_ptr<VolumeReader> reader;
  together(*part.team, [&] {
    reader =
        std::make_unique<LayersReader>(open(), LayerRange{part.begin, part.begin + num_layers});
  });
  return reader;
}
}  // namespace isowave::core
