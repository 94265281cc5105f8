#include "core/zfp/voxel_sample.hpp"

#include <bit>
#include <cmath>
#include <limits>

#include "core/base/parallel_for.hpp"
#include "core/zfp/block_decoder.hpp"
#include "core/zfp/no_data.hpp"
#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

/// Blocks that one work item decodes.
constexpr std::uint64_t kBatch = 256;

glm::uvec3 blocks_of(const glm::uvec3 &dims) {
  return (dims + 3u) / 4u;
}

}  // namespace

BlockSample::BlockSample(const glm::uvec3 &dims, std::uint64_t max_voxels) {
  const glm::u64vec3 blocks(blocks_of(dims));
  const std::uint64_t num_blocks = blocks.x * blocks.y * blocks.z;
  const std::uint64_t wanted = std::max<std::uint64_t>(1, max_voxels / ISO_BLOCK_VOXELS);
  stride_ = (num_blocks + wanted - 1) / wanted;
  count_ = num_blocks / stride_;
}

std::uint32_t BlockSample::block(std::uint64_t i) const {
  return sampled_block(static_cast<std::uint32_t>(i * stride_),
                       static_cast<std::uint32_t>(stride_));
}

std::vector<float> decode_sample(const CompressedVolume &volume, std::uint64_t max_voxels) {
  const BlockSample sample(volume.info.dims, max_voxels);
  std::vector<float> voxels(ISO_BLOCK_VOXELS * sample.count());
  const std::uint64_t num_batches = (sample.count() + kBatch - 1) / kBatch;
  parallel_for(num_batches, 0, [&](std::uint64_t batch, std::uint32_t) {
    BlockDecoder decoder(volume);
    const std::uint64_t end = std::min(sample.count(), (batch + 1) * kBatch);
    for (std::uint64_t i = batch * kBatch; i < end; ++i) {
      const std::uint32_t id = sample.block(i);
      const std::span<float, ISO_BLOCK_VOXELS> values(&voxels[ISO_BLOCK_VOXELS * i],
                                                      ISO_BLOCK_VOXELS);
      decoder.load(id, 1);
      decoder.decode(id, values);
      clear_no_data(~voxels_of_block(volume.info.dims, id), values);
    }
  });
  return voxels;
}

std::vector<float> sample_voxels(const CompressedVolume &volume, std::uint64_t max_voxels) {
  std::vector<float> voxels = decode_sample(volume, max_voxels);
  std::erase_if(voxels, [](float value) { return std::isnan(value); });
  return voxels;
}

LayerSampler::LayerSampler(const glm::uvec3 &dims, std::uint64_t max_voxels)
    : dims_(dims),
      sample_(dims, max_voxels),
      voxels_(ISO_BLOCK_VOXELS * sample_.count(), std::numeric_limits<float>::quiet_NaN()) {}

void LayerSampler::begin_layer(std::uint32_t z) {
  const auto layer_of = [&](std::uint64_t i) { return first_voxel(i).z / 4; };
  while (first_ < sample_.count() && layer_of(first_) < z / 4) ++first_;
  end_ = std::max(first_, end_);
  while (end_ < sample_.count() && layer_of(end_) == z / 4) ++end_;
}

glm::uvec3 LayerSampler::first_voxel(std::uint64_t i) const {
  const glm::uvec3 blocks = blocks_of(dims_);
  const std::uint32_t id = sample_.block(i);
  return 4u * glm::uvec3(id % blocks.x, id / blocks.x % blocks.y, id / blocks.x / blocks.y);
}

}  // namespace isowave::core
