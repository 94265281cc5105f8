// Bounds of how far blocks are off, as they are stored: against voxels before compression, and
// between those of coarser levels of detail.

#include "core/zfp/level_bounds.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "kernels_cl/portable/block_bound.h"
#include "kernels_cl/portable/grid_dda.h"
#include "reference/cell_oracle.hpp"
#include "reference/twin.hpp"
#include "tests/bounds_scene.hpp"

namespace isowave::core {
namespace {

using test::BoundsScene;

TEST(BlockBound, CodesAscendByASixteenth) {
  EXPECT_EQ(block_bound(0), 0.0f);
  EXPECT_EQ(block_bound(255), ISO_BOUND_MAX);
  for (uint code = 1; code < 256; ++code) {
    EXPECT_GT(block_bound(code), block_bound(code - 1));
    if (code > 16) {
      EXPECT_LE(block_bound(code), block_bound(code - 1) * 1.0625f);
    }
  }
}

TEST(BlockBound, AreNeverBelow) {
  for (const float scale : {0x1p-120f, 1e-3f, 1.0f, 3e20f}) {
    std::vector<float> bounds = {0.0f};
    for (int i = 0; i < 400; ++i) bounds.push_back(scale / (1.0f + float(i * i)));
    const BlockBounds coded = encode_bounds(bounds);
    for (std::size_t i = 0; i < bounds.size(); ++i) {
      const double value = std::ldexp(double{block_bound(coded.codes[i])}, coded.exponent);
      EXPECT_GE(value, double{bounds[i]});
      if (scale > 0x1p-100f) {
        EXPECT_LE(value, 1.07 * double{bounds[i]} + 4e-6 * double{scale});
      }
    }
  }
  EXPECT_THAT(encode_bounds(std::array{0.0f, 0.0f}).codes, testing::Each(0));
}

TEST(BlockBound, SharesGrowTowardsOneVoxel) {
  std::array<int, ISO_BOUND_PLACES> num_voxels{};
  for (uint voxel = 0; voxel < ISO_BLOCK_VOXELS; ++voxel) ++num_voxels.at(bound_place(voxel));
  EXPECT_THAT(num_voxels, testing::ElementsAre(45, 18, 1));
  EXPECT_EQ(bound_place(1 + 4 + 16), 2u);
  EXPECT_EQ(bound_place(3 + 4 + 16), 1u);
  EXPECT_EQ(bound_place(3 + 48), 1u);
  EXPECT_EQ(bound_place(2 + 8 + 32), 1u);
  EXPECT_EQ(bound_place(3 + 4), 0u);
  EXPECT_LT(bound_share(0), bound_share(1));
  EXPECT_LT(bound_share(1), bound_share(2));
  EXPECT_EQ(bound_share(2), 1.0f);
}

/// However the volume was compressed: no voxel is off by more than its share of its block's bound,
/// and some voxel of most blocks by nearly as much.
TEST(BlockBound, NoVoxelExceedsItsShare) {
  const glm::uvec3 dims(37, 40, 42);
  for (const auto &field : {test::gyroid_field(15), test::noise_field(5)}) {
    for (const CompressOptions &options :
         {CompressOptions{.rate = 4}, CompressOptions{.rate = 11},
          // The largest error not known, and known, as to convert.
          CompressOptions{.precision = BlockPrecision{.min_exponent = -5}},
          CompressOptions{.precision =
                              BlockPrecision{.min_exponent = -5, .max_voxel_error = 0.03125}}}) {
      const BoundsScene scene(dims, field, options);
      const BlockBounds &bounds = scene.volume.bounds;
      ASSERT_TRUE(bounds.by_place);
      const std::vector<float> decoded = decode_with_libzfp(scene.volume);
      const ValueOffset offset{0, std::ldexp(1.0f, bounds.exponent)};
      const glm::uvec3 blocks = scene.volume.num_blocks();
      std::vector<double> closest(bounds.codes.size(), 0.0);
      for (std::size_t i = 0; i < decoded.size(); ++i) {
        const glm::uvec3 at(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y), in = at % 4u;
        const std::size_t block =
            at.x / 4 + blocks.x * (at.y / 4 + std::size_t{blocks.y} * (at.z / 4));
        const double most =
            double{offset_of_voxel(offset, bounds, block, in.x + 4 * in.y + 16 * in.z)};
        const double off = std::abs(double{decoded[i]} - double{scene.source[i]});
        ASSERT_LE(off, most) << "voxel " << i;
        if (most > 0) closest[block] = std::max(closest[block], off / most);
      }
      std::ranges::sort(closest);
      EXPECT_GT(closest[closest.size() / 10], 1 / 1.0625 - 1e-6);
    }
  }
}

/// The field that bounds span, trilinear like the volume's own, over the difference of a level from
/// the volume: the least of many places at random. Below 1, a bound is exceeded.
double least_slack(const BoundsScene &scene, std::size_t level, int num_places) {
  const glm::uvec3 dims = scene.volume.info.dims;
  const CompressedVolume &coarse = scene.volume.coarser_levels[level];
  const std::vector<float> voxels = decode_with_libzfp(coarse);
  const glm::uvec3 n = coarse.info.dims, blocks = coarse.num_blocks();
  std::vector<float> bounds(voxels.size());
  for (std::uint32_t z = 0; z < n.z; ++z) {
    for (std::uint32_t y = 0; y < n.y; ++y) {
      for (std::uint32_t x = 0; x < n.x; ++x) {
        const std::size_t block = x / 4 + blocks.x * (y / 4 + std::size_t{blocks.y} * (z / 4));
        bounds[x + n.x * (y + std::size_t{n.y} * z)] =
            std::ldexp(block_bound(coarse.bounds.codes[block]), coarse.bounds.exponent);
      }
    }
  }
  const CellOracle truth(scene.source, {dims.x, dims.y, dims.z}, 0.5f);
  const CellOracle coarse_field(voxels, {n.x, n.y, n.z}, 0.5f),
      bound(bounds, {n.x, n.y, n.z}, 0.5f);
  const double scale = double(2u << level);
  std::mt19937 random(5);
  double least = 1e9;
  for (int i = 0; i < num_places; ++i) {
    std::array<double, 3> fine{}, at{};
    for (int axis = 0; axis < 3; ++axis) {
      fine[std::size_t(axis)] = double(dims[axis] - 1) * double(random()) * 0x1p-32;
      at[std::size_t(axis)] = fine[std::size_t(axis)] / scale;
    }
    const double off = std::abs(coarse_field.field(at) - truth.field(fine));
    if (off > 0) least = std::min(least, (bound.field(at) + 1e-6) / off);
  }
  return least;
}

TEST(PlaneError, CountsTheRoundingOfIntegersThatWereOff) {
  const BlockPrecision exact{.min_exponent = -1, .whole_numbers = true, .max_voxel_error = 0},
      off{.min_exponent = -1, .whole_numbers = true, .max_voxel_error = 1},
      unknown{.min_exponent = -1, .whole_numbers = true}, floats{.min_exponent = -6};
  EXPECT_EQ(plane_error(exact, 4), 4);
  EXPECT_EQ(plane_error(off, 4), 5);
  EXPECT_EQ(plane_error(unknown, 4), 5);
  EXPECT_EQ(plane_error(floats, 4), 4);
  EXPECT_EQ(plane_error(exact, 0.9), 0) << "no error of integers is below 1";
  EXPECT_TRUE(with_fewer_planes(exact, 4).whole_numbers);
}

TEST(LevelBounds, HoldBetweenVoxels) {
  for (const auto &[dims, rate] :
       {std::pair(glm::uvec3(33, 32, 40), 16u), std::pair(glm::uvec3(17, 41, 20), 16u),
        std::pair(glm::uvec3(33, 32, 40), 4u)}) {
    const BoundsScene scene(dims, test::noise_field(3), {.rate = rate});
    for (std::size_t level = 0; level < scene.volume.coarser_levels.size(); ++level) {
      const double slack = least_slack(scene, level, 200000);
      EXPECT_GE(slack, 1) << "level " << level + 1;
      EXPECT_LT(slack, 2.5) << "a bound that is never needed, level " << level + 1;
    }
  }
}

/// Steps of a unit of the last place, alike for all voxels that share an x: what a comparison of
/// levels may lose.
TEST(LevelBounds, HoldFarFromZero) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    std::array<double, 33> steps;
    std::mt19937 random(seed);
    for (double &step : steps) step = 0.25 * double(random() % 4);
    const auto field = [&steps](const glm::dvec3 &at) {
      return 3e6 + steps.at(std::size_t(std::rint(at.x)));
    };
    const BoundsScene scene({33, 8, 8}, field, {.rate = 32});
    for (std::size_t level = 0; level < scene.volume.coarser_levels.size(); ++level)
      EXPECT_GE(least_slack(scene, level, 5000), 1) << "seed " << seed << ", level " << level + 1;
  }
}

}  // namespace
}  // namespace isowave::core
