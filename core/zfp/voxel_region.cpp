#include "core/zfp/voxel_region.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/zfp/block_decoder.hpp"

namespace isowave::core {

namespace {

/// Blocks along x that one work item decodes, and reads at once if they are neighbours.
constexpr std::uint32_t kRowBlocks = 64;

/// The voxels of a region within a layer of blocks, along one axis.
struct Part {
  std::uint32_t block = 0;  ///< the layer
  std::uint32_t begin = 0;  ///< the first of them in the output
  std::uint32_t count = 0;
  std::uint32_t inside = 0;  ///< where in the block that is, 0..3; the others follow by the step
};

std::vector<Part> parts_along(const VoxelRegion &region, int axis) {
  std::vector<Part> parts;
  for (std::uint32_t i = 0, voxel = region.begin[axis]; i < region.dims()[axis]; ++i) {
    if (parts.empty() || parts.back().block != voxel / 4)
      parts.push_back({.block = voxel / 4, .begin = i, .count = 0, .inside = voxel % 4});
    ++parts.back().count;
    voxel += region.step[axis];
  }
  return parts;
}

/// Copies those voxels of a block that are in the region.
void copy_voxels(std::span<const float> block, const std::array<const Part *, 3> &parts,
                 const VoxelRegion &region, float *out) {
  const auto [x, y, z] = parts;
  const glm::uvec3 dims = region.dims(), step = region.step;
  for (std::uint32_t k = 0; k < z->count; ++k) {
    for (std::uint32_t j = 0; j < y->count; ++j) {
      const std::uint64_t row = std::uint64_t{z->begin + k} * dims.y + y->begin + j;
      float *to = out + row * dims.x + x->begin;
      const std::uint32_t from = 16 * (z->inside + k * step.z) + 4 * (y->inside + j * step.y);
      for (std::uint32_t i = 0; i < x->count; ++i) to[i] = block[from + x->inside + i * step.x];
    }
  }
}

}  // namespace

void check_region(const VoxelRegion &region, const glm::uvec3 &dims) {
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t begin = region.begin[axis], end = region.end[axis];
    if (begin >= end || end > dims[axis] || region.step[axis] == 0) {
      throw Error("region {} to {} in steps of {} along {}: must hold a voxel, and end by {}",
                  begin, end, region.step[axis], "xyz"[axis], dims[axis]);
    }
  }
}

void decode_region(const CompressedVolume &volume, const VoxelRegion &region,
                   std::span<float> out) {
  check_region(region, volume.info.dims);
  const glm::u64vec3 dims(region.dims());
  if (out.size() != dims.x * dims.y * dims.z)
    throw std::invalid_argument("decode_region: the output has not the size of the region");
  const std::array<std::vector<Part>, 3> parts = {parts_along(region, 0), parts_along(region, 1),
                                                  parts_along(region, 2)};
  const glm::u64vec3 blocks(volume.num_blocks());
  const std::uint64_t num_batches = (parts[0].size() + kRowBlocks - 1) / kRowBlocks;
  parallel_for(num_batches * parts[1].size() * parts[2].size(), 0, [&](std::uint64_t item, auto) {
    const Part &y = parts[1][item / num_batches % parts[1].size()];
    const Part &z = parts[2][item / num_batches / parts[1].size()];
    const std::uint64_t row = blocks.x * (y.block + blocks.y * z.block);
    const std::uint64_t first = item % num_batches * kRowBlocks;
    const std::span batch = std::span(parts[0]).subspan(
        first, std::min<std::uint64_t>(kRowBlocks, parts[0].size() - first));
    BlockDecoder decoder(volume);
    // A step may leave out blocks; then each is read alone.
    const bool neighbours = batch.back().block - batch.front().block + 1 == batch.size();
    if (neighbours) decoder.load(row + batch.front().block, batch.size());
    for (const Part &x : batch) {
      std::array<float, ISO_BLOCK_VOXELS> block;
      if (!neighbours) decoder.load(row + x.block, 1);
      decoder.decode(row + x.block, block);
      copy_voxels(block, {&x, &y, &z}, region, out.data());
    }
  });
}

}  // namespace isowave::core
