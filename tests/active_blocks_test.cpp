// core/stages/active_blocks against a plain loop over all blocks.

#include "core/stages/active_blocks.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "core/view/frame.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

class ActiveBlocksOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Random blocks are active, one of `one_of`; those that own no cell never are.
  void expect_list(const glm::uvec3 &dims, uint one_of) {
    SCOPED_TRACE(fmt::format("{}x{}x{} voxels, one of {}", dims.x, dims.y, dims.z, one_of));
    const FrameParams frame = grid_frame(dims);
    const glm::uvec3 blocks = (dims + 3u) / 4u, coarse = (blocks + 3u) / 4u;
    const std::size_t num_coarse = std::size_t{coarse.x} * coarse.y * coarse.z;
    Random random(dims.x + one_of);
    const auto owns = [&](const glm::uvec3 &b) {
      return glm::all(glm::lessThan(4u * b + 1u, dims));
    };
    std::vector<bool> active(std::size_t{blocks.x} * blocks.y * blocks.z);
    const auto place = [&](const glm::uvec3 &b) { return b.x + blocks.x * (b.y + blocks.y * b.z); };
    const auto each_block = [&](const auto &visit) {
      for (uint cell = 0; cell < num_coarse; ++cell) {
        for (uint bit = 0; bit < 64; ++bit) {
          const glm::uvec3 b = 4u * glm::uvec3(cell % coarse.x, cell / coarse.x % coarse.y,
                                               cell / coarse.x / coarse.y) +
                               glm::uvec3(bit % 4, bit / 4 % 4, bit / 16);
          if (glm::all(glm::lessThan(b, blocks))) visit(b, cell, bit);
        }
      }
    };
    std::vector<uint> masks(2 * num_coarse);
    each_block([&](const glm::uvec3 &b, uint cell, uint bit) {
      if (!owns(b) || random() % one_of != 0) return;
      active[place(b)] = true;
      masks[2 * cell + bit / 32] |= 1u << bit % 32;
    });
    std::vector<uint> expected, expected_masks(masks), offsets;
    each_block([&](const glm::uvec3 &b, uint cell, uint bit) {
      while (offsets.size() <= cell) offsets.push_back(static_cast<uint>(expected.size()));
      glm::uvec3 holds_cells = b;
      for (int axis = 0; axis < 3; ++axis) {
        if (4 * b[axis] + 1 == dims[axis]) --holds_cells[axis];
      }
      if (!active[place(holds_cells)]) return;
      expected.push_back(place(b));
      expected_masks[2 * cell + bit / 32] |= 1u << bit % 32;
    });
    offsets.push_back(static_cast<uint>(expected.size()));

    const ocl::Buffer<uint> on_device(device_, "masks", std::span<const uint>(masks));
    ActiveBlocks listed(device_, num_coarse);
    ASSERT_EQ(listed.count(frame, on_device), expected.size());
    ocl::Buffer<uint> ids(device_, "ids", expected.size());
    listed.list(frame, ids);
    EXPECT_EQ(first_difference(ids.read(), expected), kNoDifference);
    EXPECT_EQ(first_difference(listed.masks().read(), expected_masks), kNoDifference);
    EXPECT_EQ(first_difference(listed.offsets().read(), offsets), kNoDifference);
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, ActiveBlocksOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(ActiveBlocksOnDevice, SmallBlocksOfOneLayerAreListedWithTheirCells) {
  for (const glm::uvec3 dims : {glm::uvec3(5, 5, 5), glm::uvec3(17, 6, 9), glm::uvec3(8, 4, 13)}) {
    for (const uint one_of : {1u, 3u}) expect_list(dims, one_of);
  }
}

TEST_P(ActiveBlocksOnDevice, NoneAllAndSome) {
  for (const uint one_of : {0xFFFFFFFFu, 1u, 2u, 50u}) {
    expect_list({129, 65, 66}, one_of);
    expect_list({64, 64, 64}, one_of);
  }
}

}  // namespace
}  // namespace isowave::core
