#include "core/bricks/brick_volume.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "core/bricks/cuts.hpp"
#include "core/ocl/device.hpp"
#include "core/volume/range_thresholds.hpp"
#include "core/zfp/block_decoder.hpp"
#include "core/zfp/cut_blocks.hpp"
#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

/// A box of a volume's voxels.
class CroppedReader : public VolumeReader {
 public:
  CroppedReader(std::unique_ptr<VolumeReader> whole, const VolumeInfo &info)
      : whole_(std::move(whole)) {
    info_ = info;
  }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    crop(z_begin, num_layers, out, floats_,
         [this](std::uint32_t z, std::span<float> layer) { whole_->read_layers(z, 1, layer); });
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override {
    crop(z_begin, num_layers, out, doubles_, [this](std::uint32_t z, std::span<double> layer) {
      whole_->read_exact_layers(z, 1, layer);
    });
  }

 private:
  /// layer: as large as one of the whole.
  template <class Value, class Read>
  void crop(std::uint32_t z_begin, std::uint32_t num_layers, std::span<Value> out,
            std::vector<Value> &layer, const Read &read) {
    const glm::uvec3 &dims = whole_->info().dims, &first = info_.brick.first_voxel;
    layer.resize(std::size_t{dims.x} * dims.y);
    auto to = out.begin();
    for (std::uint32_t z = z_begin; z < z_begin + num_layers; ++z) {
      read(first.z + z, std::span(layer));
      for (std::uint32_t y = 0; y < info_.dims.y; ++y) {
        const auto row = layer.begin() + std::ptrdiff_t(first.x) +
                         std::ptrdiff_t(dims.x) * std::ptrdiff_t(first.y + y);
        to = std::copy_n(row, info_.dims.x, to);
      }
    }
  }

  std::unique_ptr<VolumeReader> whole_;
  std::vector<float> floats_;
  std::vector<double> doubles_;
};

CompressedVolume as_brick(CompressedVolume kept, const VolumeInfo &whole, const BlockBox &own) {
  kept.info = brick_info(whole, own);
  return kept;
}

}  // namespace

BlockBox kept_blocks(const glm::ivec3 &blocks, const BlockBox &own) {
  return {glm::max(own.begin - 1, glm::ivec3(0)), glm::min(own.end + 1, blocks)};
}

VolumeInfo brick_info(const VolumeInfo &whole, const BlockBox &own) {
  const BlockBox kept = kept_blocks(blocks_along(whole), own);
  VolumeInfo info = whole;
  const glm::uvec3 begin = 4u * glm::uvec3(kept.begin);
  info.dims = glm::min(4u * glm::uvec3(kept.end), whole.dims) - begin;
  info.brick = {begin, glm::uvec3(own.begin - kept.begin), glm::uvec3(kept.end - own.end)};
  return info;
}

CompressedVolume cut_brick(const CompressedVolume &whole, const BlockBox &own) {
  return as_brick(cut_blocks(whole, kept_blocks(blocks_along(whole.info), own)), whole.info, own);
}

CompressedVolume read_brick(const std::filesystem::path &path, const BlockBox &own) {
  const VolumeInfo whole = read_zfp_file_info(path).info;
  return as_brick(read_zfp_blocks(path, kept_blocks(blocks_along(whole), own)), whole, own);
}

CompressedVolume compress_brick(const OpenReader &open, std::string_view what,
                                const Storage &storage, const BlockBox &own) {
  std::unique_ptr<VolumeReader> whole = open();
  const VolumeInfo info = brick_info(whole->info(), own);
  CompressOptions options;
  options.rate = storage.rate;
  options.precision = find_precision(open, what, storage);
  options.input = {storage.map_nan, {}, storage.num_threads};
  options.device = options.precision ? nullptr : storage.device;
  CroppedReader reader(std::move(whole), info);
  CompressedVolume volume = compress(reader, options);
  if (storage.device) storage.device->timer().collect();  // they belong to no frame
  return volume;
}

std::vector<float> range_samples(const CompressedVolume &brick, const VolumeInfo &whole) {
  const glm::ivec3 kept = blocks_along(brick.info), all = blocks_along(whole);
  const bool has_ids = num_blocks({glm::ivec3(0), all}) < ISO_MAX_BLOCK_IDS;
  const glm::ivec3 blocks = has_ids ? all : kept;
  const glm::ivec3 first(has_ids ? brick.info.brick.first_voxel / 4u : glm::uvec3(0));
  const glm::ivec3 own_begin(brick.info.brick.before),
      own_end = kept - glm::ivec3(brick.info.brick.behind);
  const RangeSample sample = range_sample(num_blocks({glm::ivec3(0), blocks}));
  BlockDecoder decoder(brick);
  std::vector<float> values;
  for (std::uint32_t i = 0; i < sample.count; ++i) {
    const auto id = static_cast<int>(sampled_block(i * sample.stride, sample.stride));
    const glm::ivec3 at =
        glm::ivec3(id % blocks.x, id / blocks.x % blocks.y, id / blocks.x / blocks.y) - first;
    if (glm::any(glm::lessThan(at, own_begin)) || glm::any(glm::greaterThanEqual(at, own_end)))
      continue;
    std::array<float, ISO_BLOCK_VOXELS> voxels{};
    const std::uint64_t block =
        glm::u64vec3(at).x +
        std::uint64_t(kept.x) * (glm::u64vec3(at).y + std::uint64_t(kept.y) * glm::u64vec3(at).z);
    decoder.load(block, 1);
    decoder.decode(block, voxels);
    const glm::uvec3 size = glm::min(brick.info.dims - 4u * glm::uvec3(at), glm::uvec3(4));
    float least = voxels[0], most = voxels[0];
    for (std::uint32_t z = 0; z < size.z; ++z) {
      for (std::uint32_t y = 0; y < size.y; ++y) {
        const auto row = voxels.begin() + std::ptrdiff_t(4 * y + 16 * z);
        const auto [low, high] = std::minmax_element(row, row + std::ptrdiff_t(size.x));
        least = std::min(least, *low);
        most = std::max(most, *high);
      }
    }
    values.push_back(least);
    values.push_back(most);
  }
  return values;
}

}  // namespace isowave::core
