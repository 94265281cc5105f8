// Positions of hits in the world, on devices and on the host.

#include "core/stages/hit_positions.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "core/frame/frame_arrays.hpp"
#include "core/volume/world_positions.hpp"
#include "tests/frame_scene.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using Position = std::array<double, 3>;

/// Two levels of detail; the second has voxels twice as far apart.
std::vector<VolumeInfo> two_levels(const glm::dvec3 &origin) {
  std::vector<VolumeInfo> levels{test::grid_info({33, 20, 21}, {1, 0.3, 2}),
                                 test::grid_info({17, 11, 11}, {2, 0.6, 4})};
  for (VolumeInfo &level : levels) {
    level.origin = origin;
    level.direction = {{0.8, 0.6, 0}, {-0.6, 0.8, 0}, {0, 0, 1}};
  }
  return levels;
}

/// Hits of levels of detail are where the finest level's voxels are.
TEST(HitPositions, CellsOfLevelsAreFoundByTheirBlocks) {
  const HitMap map = make_hit_map(two_levels({0, 0, 0}));
  EXPECT_EQ(map.num_levels, 2u);
  const uint layer = map.blocks_x * map.blocks_y;
  // The second block along each axis of the coarser level, its last cell.
  const uint block = 1 + map.blocks_x * (1 + map.blocks_y * (map.begin_z[1] + 1));
  const HitCell cell = hit_cell(&map, block, 63);
  EXPECT_EQ(cell.level, 1u);
  EXPECT_EQ((std::array{cell.x, cell.y, cell.z}), (std::array{7u, 7u, 7u}));
  EXPECT_EQ(hit_cell(&map, layer * map.begin_z[1] - 1, 0).level, 0u) << "the finest's last block";
  HitRecord hit{};
  hit.block_id = block;
  hit.cell = 63;
  hit.x = 0.5f;
  Position position;
  hit_position(&map, hit, position.data());
  const glm::dvec3 expected = WorldPositions(two_levels({0, 0, 0})[0])({15, 14, 14});
  EXPECT_EQ(position, (Position{expected.x, expected.y, expected.z}));
}

/// Near the world's origin, positions are rounded to float32; far from it, they are not.
TEST(HitPositionsOnDevice, SmallHaveTheHostsBits) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> in_cell(0, 1);
  for (const ocl::DeviceInfo &info : devices_under_test()) {
    ocl::Device device(info);
    if (!HitPositions::suits(device)) continue;  // the host computes them
    HitPositions stage(device);
    for (const double distance : {1.0, 1e7}) {
      const HitMap map = make_hit_map(two_levels({distance, -distance, 3}));
      EXPECT_EQ(map.is_float32, distance == 1.0 ? 1u : 0u);
      const uint num_blocks = map.blocks_x * map.blocks_y * (map.begin_z[1] + 3);
      std::vector<HitRecord> hits(100);
      for (HitRecord &hit : hits) {
        hit.t = random() % 8 == 0 ? std::numeric_limits<float>::infinity() : 1.0f;
        hit.block_id = static_cast<uint>(random() % num_blocks);
        hit.cell = static_cast<uint>(random() % 64);
        hit.x = in_cell(random);
        hit.y = in_cell(random);
        hit.z = in_cell(random);
      }
      const ocl::Buffer<HitRecord> on_device(device, "hits", hits);
      constexpr std::size_t kBegin = 20, kCount = 70;
      ocl::Buffer<std::byte> positions(device, "positions", kCount * sizeof(Position));
      stage(map, kBegin, kCount, on_device, positions);
      const std::vector<std::byte> bytes = positions.read();
      std::size_t num_none = 0;
      for (std::size_t i = 0; i < kCount; ++i) {
        Position expected;
        hit_position(&map, hits[kBegin + i], expected.data());
        EXPECT_EQ(std::memcmp(&bytes[i * sizeof(Position)], expected.data(), sizeof(Position)), 0);
        num_none += std::isnan(expected[0]);
      }
      EXPECT_GT(num_none, 0u);
    }
  }
}

}  // namespace
}  // namespace isowave::core
