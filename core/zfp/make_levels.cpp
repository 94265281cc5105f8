#include "core/zfp/make_levels.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/volume/pyramid.hpp"
#include "core/zfp/voxel_region.hpp"

namespace isowave::core {

namespace {

constexpr std::uint64_t kLevelVoxels = 1u << 24;  ///< that are decoded at a time, about

/// The voxels of the next coarser level of a volume.
class CoarserReader : public VolumeReader {
 public:
  explicit CoarserReader(const CompressedVolume &fine)
      : fine_(fine), downsampler_(fine.info.dims, 0, [this](const Chunk &chunk) {
          made_.insert(made_.end(), chunk.voxels.begin(), chunk.voxels.end());
        }) {
    info_ = coarser_level(fine.info);
  }

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    const std::size_t layer = std::size_t{info_.dims.x} * info_.dims.y;
    made_.erase(made_.begin(), made_.begin() + std::ptrdiff_t((z_begin - made_begin_) * layer));
    made_begin_ = z_begin;
    while (made_.size() < num_layers * layer) add_fine_layers();
    std::copy_n(made_.begin(), num_layers * layer, out.begin());
  }

 private:
  void add_fine_layers() {
    const glm::uvec3 dims = fine_.info.dims;
    const std::uint64_t layer = std::uint64_t{dims.x} * dims.y;
    const auto count = static_cast<std::uint32_t>(std::max<std::uint64_t>(kLevelVoxels / layer, 1));
    const std::uint32_t end = std::min(dims.z, (next_ + 4 * ((count + 3) / 4)));
    std::vector<float> voxels(layer * (end - next_));
    decode_region(fine_, {{0, 0, next_}, {dims.x, dims.y, end}, {1, 1, 1}}, voxels);
    next_ = end;
    downsampler_.add(voxels);
  }

  const CompressedVolume &fine_;
  std::uint32_t next_ = 0;  ///< layer of the fine volume
  std::vector<float> made_{};
  std::uint32_t made_begin_ = 0;  ///< layer of the coarser one that made_ begins with
  Downsampler downsampler_;
};

}  // namespace

std::vector<CompressedVolume> make_levels(const CompressedVolume &volume) {
  if (max_levels(volume.info.dims) == 1) return {};
  CompressOptions options;
  options.levels = 0;
  if (volume.is_indexed()) {
    options.precision = BlockPrecision{.min_exponent = volume.precision.min_exponent};
  } else {
    options.rate = std::clamp((volume.bits_per_block + 63) / 64, 1u, 32u);
  }
  CoarserReader reader(volume);
  CompressedVolume first = compress(reader, options);
  std::vector<CompressedVolume> levels = std::move(first.coarser_levels);
  first.coarser_levels.clear();
  levels.insert(levels.begin(), std::move(first));
  return levels;
}

}  // namespace isowave::core
