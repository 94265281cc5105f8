#include "core/bricks/brick_volume.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/bricks/cuts.hpp"
#include "core/ocl/device.hpp"
#include "core/stages/zfp_encode.hpp"
#include "core/view/detail.hpp"
#include "core/view/frame.hpp"
#include "core/volume/range_thresholds.hpp"
#include "core/zfp/block_decoder.hpp"
#include "core/zfp/cut_blocks.hpp"
#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

/// A box of voxels that a device makes.
class VoxelsOfBox : public VoxelsInPlace {
 public:
  VoxelsOfBox(VoxelsInPlace &whole, const glm::uvec3 &first) : whole_(whole), first_(first) {}
  void make(const glm::uvec3 &begin, const glm::uvec3 &dims, ocl::Buffer<float> &voxels) override {
    whole_.make(first_ + begin, dims, voxels);
  }
  std::array<float, 2> range() override { return whole_.range(); }

 private:
  VoxelsInPlace &whole_;
  glm::uvec3 first_;
};

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

  DeviceVoxels *on_device() override {
    auto *whole = dynamic_cast<VoxelsInPlace *>(whole_->on_device());
    return whole != nullptr ? &made_.emplace(*whole, info_.brick.first_voxel) : nullptr;
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
  std::optional<VoxelsOfBox> made_{};
  std::vector<float> floats_;
  std::vector<double> doubles_;
};

/// The same box at a coarser level, which ends where that does.
BlockBox own_of_level(const VolumeInfo &whole, const BlockBox &own, const VolumeInfo &info,
                      std::size_t level) {
  const glm::ivec3 all = blocks_along(whole);
  BlockBox box{own.begin >> int(level), own.end >> int(level)};
  for (int axis = 0; axis < 3; ++axis) {
    if (own.end[axis] == all[axis]) box.end[axis] = blocks_along(info)[axis];
  }
  return box;
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

CompressedVolume cut_brick(const CompressedVolume &whole, const BlockBox &own,
                           std::size_t num_levels) {
  CompressedVolume brick;
  for (std::size_t i = 0; i < num_levels; ++i) {
    const CompressedVolume &level = i == 0 ? whole : whole.coarser_levels.at(i - 1);
    const BlockBox of_level = own_of_level(whole.info, own, level.info, i);
    CompressedVolume cut = cut_blocks(level, kept_blocks(blocks_along(level.info), of_level));
    cut.info = brick_info(level.info, of_level);
    if (i == 0) {
      brick = std::move(cut);
    } else {
      brick.coarser_levels.push_back(std::move(cut));
    }
  }
  return brick;
}

CompressedVolume read_brick(const std::filesystem::path &path, const BlockBox &own,
                            std::size_t num_levels, bool with_bounds) {
  const CompressedVolume whole = read_zfp_file_info(path);
  std::vector<BlockBox> own_of, kept;
  std::vector<VolumeInfo> infos;
  for (std::size_t i = 0; i < num_levels; ++i) {
    infos.push_back(i == 0 ? whole.info : whole.coarser_levels.at(i - 1).info);
    own_of.push_back(own_of_level(whole.info, own, infos.back(), i));
    kept.push_back(kept_blocks(blocks_along(infos.back()), own_of.back()));
  }
  CompressedVolume brick = read_zfp_blocks(path, kept, with_bounds);
  for (std::size_t i = 0; i < num_levels; ++i)
    (i == 0 ? brick : brick.coarser_levels[i - 1]).info = brick_info(infos[i], own_of[i]);
  return brick;
}

CompressedVolume compress_brick(const OpenReader &open, std::string_view what,
                                const Storage &storage, const BlockBox &own) {
  std::unique_ptr<VolumeReader> whole = open();
  const VolumeInfo info = brick_info(whole->info(), own);
  CompressOptions options;
  options.rate = storage.rate.value_or(0);
  options.precision = find_precision(open, what, storage);
  options.measure_error = storage.measure_error;
  options.input = {storage.map_nan, storage.no_data, {}, storage.num_threads};
  if (!options.precision) options.encoder = storage.encoder;
  CroppedReader reader(std::move(whole), info);
  return compress(reader, options);
}

std::vector<VolumeInfo> read_levels(const std::string &path, const RawOverrides &overrides) {
  if (!is_zfp_name(path)) return {open_any_volume(path, overrides)->info()};
  if (overrides.dims || overrides.type) throw Error("{}: dims and type are for raw files", path);
  check_has_step(path, overrides.step);
  CompressedVolume volume = read_zfp_file_info(path);
  if (overrides.spacing) set_spacing(volume, *overrides.spacing);
  check_volume_info(volume.info, path);
  return level_infos(volume, true);
}

CompressedVolume load_brick(const std::string &path, const RawOverrides &overrides,
                            const Storage &storage, const VolumeInfo &info, std::size_t num_levels,
                            const BlockBox &own) {
  check_drawable(brick_info(info, own), path);
  if (is_zfp_name(path)) {
    CompressedVolume volume = read_brick(path, own, num_levels, storage.measure_error);
    set_spacing(volume, info.spacing);
    return volume;
  }
  return compress_brick([&] { return open_any_volume(path, overrides, storage.noise); }, path,
                        storage, own);
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
    float least = std::numeric_limits<float>::infinity(), most = -least;
    for (std::uint32_t z = 0; z < size.z; ++z) {
      for (std::uint32_t y = 0; y < size.y; ++y) {
        for (std::uint32_t x = 0; x < size.x; ++x) {  // NaN of voxels without data changes nothing
          const float voxel = voxels.at(x + 4 * y + 16 * z);
          least = voxel < least ? voxel : least;
          most = voxel > most ? voxel : most;
        }
      }
    }
    values.push_back(least);
    values.push_back(most);
  }
  return values;
}

}  // namespace isowave::core
