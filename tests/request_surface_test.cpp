// core/stages/request_surface: which blocks are asked for, against a plain loop over the voxels
// that vertices, gradients and cells are made of.

#include "core/stages/request_surface.hpp"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "tests/stage_world.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

/// Blocks of the voxels that a mesh of block b is made of.
std::set<uint> blocks_needed(const FrameParams &frame, uint block_id, bool with_gradients) {
  const glm::ivec3 dims(frame.grid.dims_x, frame.grid.dims_y, frame.grid.dims_z);
  const glm::ivec3 blocks(frame.grid.blocks_x, frame.grid.blocks_y, frame.grid.blocks_z);
  const glm::ivec3 first = 4 * glm::ivec3(block_id % blocks.x, block_id / blocks.x % blocks.y,
                                          block_id / blocks.x / blocks.y);
  std::set<uint> needed;
  const auto add = [&](const glm::ivec3 &voxel) {
    if (glm::any(glm::lessThan(voxel, glm::ivec3(0))) ||
        glm::any(glm::greaterThanEqual(voxel, dims)))
      return;
    const glm::ivec3 b = voxel / 4;
    needed.insert(static_cast<uint>(b.x + blocks.x * (b.y + blocks.y * b.z)));
  };
  for (int corner = 0; corner < 125; ++corner)
    add(first + glm::ivec3(corner % 5, corner / 5 % 5, corner / 25));
  for (int v = 0; v < 64 && with_gradients; ++v) {
    for (int edge = 0; edge < 4; ++edge) {  // 0: the voxel itself, else the upper end of its edge
      glm::ivec3 at = first + glm::ivec3(v % 4, v / 4 % 4, v / 16);
      if (edge != 0) ++at[edge - 1];
      for (int axis = 0; axis < 3; ++axis) {
        glm::ivec3 beside = at;
        --beside[axis];
        add(beside);
        beside[axis] += 2;
        add(beside);
      }
    }
  }
  return needed;
}

class RequestSurfaceOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void expect_requests(const glm::uvec3 &dims, std::vector<uint> ids, Gradients gradients) {
    const bool smooth = gradients == Gradients::kSmooth;
    SCOPED_TRACE(fmt::format("{}x{}x{} voxels, {} blocks, gradients {}", dims.x, dims.y, dims.z,
                             ids.size(), smooth));
    StageWorld world(device_, plain_frame(dims, 64), 300, 8);
    const ocl::Buffer<uint> block_ids(device_, "ids", std::span<const uint>(ids));
    RequestSurface request(device_, gradients);
    std::set<uint> all, first_half;
    const auto half = static_cast<uint>(ids.size() / 2), end = static_cast<uint>(ids.size());
    for (uint i = 0; i < end; ++i) {
      const std::set<uint> needed = blocks_needed(world.frame, ids[i], smooth);
      all.insert(needed.begin(), needed.end());
      if (i < half) first_half.insert(needed.begin(), needed.end());
    }
    EXPECT_EQ(request.count_needed(world.frame, block_ids, end), all.size());
    // The first half is asked for, and then cached; of the second only what is missing.
    std::set<uint> cached;
    for (const auto &[begin, behind] : {std::pair(0u, half), {half, end}, {0u, end}}) {
      world.begin_pass({}, 1);
      request(block_ids, begin, behind, world.cache, world.rays);
      world.assign_slots();
      const uint num_asked = world.counts().requested_count;
      std::vector<uint> asked = world.cache.request_block_ids.read();
      asked.resize(num_asked);
      EXPECT_EQ(std::set<uint>(asked.begin(), asked.end()).size(), num_asked) << "asked for twice";
      for (const uint id : asked) EXPECT_TRUE(cached.insert(id).second) << "cached already";
      EXPECT_EQ(cached, begin == 0 && behind == half ? first_half : all);
    }
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, RequestSurfaceOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(RequestSurfaceOnDevice, SmallOneBlockAnywhere) {
  // 3 x 3 x 3 blocks: one in the middle, at a corner, at the other end.
  for (const uint id : {13u, 0u, 26u, 5u}) {
    for (const Gradients gradients : {Gradients::kNone, Gradients::kSmooth})
      expect_requests({12, 12, 12}, {id}, gradients);
  }
  EXPECT_EQ(blocks_needed(grid_frame({12, 12, 12}), 13, true).size(),
            blocks_of_block(Gradients::kSmooth));
  EXPECT_EQ(blocks_needed(grid_frame({12, 12, 12}), 13, false).size(),
            blocks_of_block(Gradients::kNone));
}

TEST_P(RequestSurfaceOnDevice, ManyBlocksAndOneLayerAtTheEnd) {
  Random random(3);
  std::vector<uint> ids;
  for (uint id = 0; id < 6 * 5 * 4; ++id) {
    if (random() % 4 == 0) ids.push_back(id);
  }
  for (const Gradients gradients : {Gradients::kNone, Gradients::kSmooth}) {
    expect_requests({24, 20, 16}, ids, gradients);
    expect_requests({21, 17, 13}, ids, gradients);
  }
}

}  // namespace
}  // namespace isowave::core
