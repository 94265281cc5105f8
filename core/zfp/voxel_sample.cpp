#include "core/zfp/voxel_sample.hpp"

#include <algorithm>
#include <array>

#include "core/base/parallel_for.hpp"
#include "core/zfp/block_decoder.hpp"
#include "kernels_cl/portable/block_grid.h"

namespace isowave::core {

namespace {

/// Blocks that one work item decodes.
constexpr std::uint64_t kBatch = 256;

void append_block(const CompressedVolume &volume, std::uint32_t id, std::vector<float> &voxels) {
  BlockDecoder decoder(volume);
  decoder.load(id, 1);
  std::array<float, ISO_BLOCK_VOXELS> values{};
  decoder.decode(id, values);
  const glm::uvec3 blocks = volume.num_blocks();
  const glm::uvec3 at =
      4u * glm::uvec3(id % blocks.x, id / blocks.x % blocks.y, id / blocks.x / blocks.y);
  const glm::uvec3 size = glm::min(volume.info.dims - at, glm::uvec3(4));
  for (std::uint32_t i = 0; i < ISO_BLOCK_VOXELS; ++i) {
    if (i % 4 >= size.x || i / 4 % 4 >= size.y || i / 16 >= size.z) continue;
    if (!is_no_data(values.at(i))) voxels.push_back(values.at(i));
  }
}

}  // namespace

std::vector<float> sample_voxels(const CompressedVolume &volume, std::uint64_t max_voxels) {
  const std::uint64_t num_blocks = volume.block_count();
  const std::uint64_t wanted = std::max<std::uint64_t>(1, max_voxels / ISO_BLOCK_VOXELS);
  const std::uint64_t stride = (num_blocks + wanted - 1) / wanted;
  const std::uint64_t num_sampled = num_blocks / stride;
  std::vector<std::vector<float>> batches((num_sampled + kBatch - 1) / kBatch);
  parallel_for(batches.size(), 0, [&](std::uint64_t batch, std::uint32_t) {
    for (std::uint64_t i = batch * kBatch; i < std::min(num_sampled, (batch + 1) * kBatch); ++i) {
      const std::uint32_t id =
          sampled_block(static_cast<std::uint32_t>(i * stride), static_cast<std::uint32_t>(stride));
      append_block(volume, id, batches[batch]);
    }
  });
  std::vector<float> voxels;
  for (const std::vector<float> &batch : batches)
    voxels.insert(voxels.end(), batch.begin(), batch.end());
  return voxels;
}

}  // namespace isowave::core
