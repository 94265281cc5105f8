// Voxels without data at coarser levels of detail: borders of data stay, small gaps close.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/render/device_renderer.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/stated_errors.hpp"
#include "core/zfp/zfp_file.hpp"
#include "reference/twin.hpp"
#include "tests/frame_scene.hpp"
#include "tests/no_data_volumes.hpp"
#include "tests/run_program.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::compressed;
using test::expect_same_hits;
using test::Hole;
using test::holes;
using test::kNone;
using test::NamedHole;
using test::num_hits;
using test::with_hole;

/// Voxels of each level without data, [nz][ny][nx] one level after the other; the finest first.
std::vector<std::vector<float>> decoded_levels(const CompressedVolume &volume) {
  std::vector<std::vector<float>> levels = {decode_with_libzfp(volume)};
  for (const CompressedVolume &level : volume.coarser_levels)
    levels.push_back(decode_with_libzfp(level));
  return levels;
}

/// At no level do data reach beyond their border; gaps of one voxel close, wider ones stay in their
/// place.
TEST(NoData, LevelsKeepBordersAndCloseSmallGaps) {
  const glm::uvec3 dims(48, 40, 36);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  struct Case {
    const char *name;
    Hole hole;
    std::uint32_t gap_begin, gap_end;  ///< along x; of the finest level
  };
  for (const Case &of :
       {Case{"half", [](const glm::uvec3 &at) { return at.x > 25; }, 26, 99},
        Case{"a voxel", [](const glm::uvec3 &at) { return at == glm::uvec3(16, 8, 8); }, 99, 99},
        Case{"a plane", [](const glm::uvec3 &at) { return at.x == 16; }, 99, 99},
        Case{"a wide gap", [](const glm::uvec3 &at) { return at.x >= 7 && at.x < 33; }, 7, 33}}) {
    SCOPED_TRACE(of.name);
    const CompressedVolume volume =
        compressed(dims, with_hole(dims, source, of.hole), {.rate = 16, .levels = 0});
    ASSERT_EQ(volume.coarser_levels.size(), 3u);
    const std::vector<std::vector<float>> levels = decoded_levels(volume);
    for (std::uint32_t level = 1; level < levels.size(); ++level) {
      const glm::uvec3 &size = volume.coarser_levels[level - 1].info.dims;
      for (std::size_t i = 0; i < levels[level].size(); ++i) {
        const std::uint32_t x = static_cast<std::uint32_t>(i % size.x) << level;
        const bool missing = x >= of.gap_begin && x < of.gap_end;
        ASSERT_EQ(std::isnan(levels[level][i]), missing) << "level " << level << ", voxel " << i;
        ASSERT_TRUE(missing || std::abs(levels[level][i]) < 4) << levels[level][i];
      }
    }
  }
}

/// The value that says "no data", and the one that replaces NaN, are those of the source alone.
TEST(NoData, LevelsTakeNoMeanForThatValue) {
  const glm::uvec3 dims(16, 16, 16);
  const std::vector<float> waves =
      test::sample(dims, [](const glm::dvec3 &at) { return int(at.x) / 2 % 2 == 0 ? 8 : -8; });
  std::vector<float> source = with_hole(
      dims, waves, [](const glm::uvec3 &at) { return at.y > 7; }, 0);
  source[0] = kNone;
  const CompressedVolume volume =
      compressed(dims, source, {.rate = 24, .levels = 2, .input = {.map_nan = 8.0f, .no_data = 0}});
  EXPECT_EQ(volume.no_data.num_voxels(), 16u * 16 * 8);
  EXPECT_EQ(volume.coarser_levels[0].no_data.num_voxels(), 9u * 9 * 5);
}

TEST(NoData, FilesKeepThoseOfLevels) {
  const glm::uvec3 dims(30, 17, 22);
  const std::vector<float> source = test::sample(dims, test::gyroid_field(9));
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.zfp", at_once = folder / "b.zfp";
  for (const NamedHole &hole : holes(dims)) {
    for (const CompressOptions &options :
         {CompressOptions{.rate = 12, .measure_error = true, .levels = 0},
          CompressOptions{.precision = BlockPrecision{.min_exponent = -8}, .levels = 0}}) {
      SCOPED_TRACE(hole.name);
      const std::vector<float> holed = with_hole(dims, source, hole.hole);
      const CompressedVolume volume = compressed(dims, holed, options);
      write_zfp_file(volume, path);
      ArrayReader reader(dims, holed);
      compress_to_file(reader, options, at_once);
      EXPECT_EQ(test::read_file(path), test::read_file(at_once));
      const CompressedVolume read = read_zfp_file(path);
      check_stated_errors(read, {});
      for (std::size_t i = 0; i < volume.coarser_levels.size(); ++i) {
        EXPECT_TRUE(std::ranges::equal(read.coarser_levels[i].no_data.table(),
                                       volume.coarser_levels[i].no_data.table()));
        EXPECT_LE(double{largest_bound(volume.coarser_levels[i].bounds)}, 3.0)
            << "bounds are those of voxels with data";
      }
    }
  }
}

class NoDataLevels : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  static constexpr ImageSize kSize{48, 32};

  /// Returns the number of hits.
  std::uint64_t check(const CompressedVolume &volume, float isovalue, double voxel_pixels,
                      StreamPlace place = StreamPlace::kDevice) {
    DeviceRenderer renderer(device_, volume, {.size = kSize, .stream = place, .with_levels = true});
    EXPECT_EQ(device_.ledger().current(), renderer.memory_plan().total());
    const Twin twin(volume, voxel_pixels);
    std::vector<Camera> cameras = orbit_cameras(volume.info, 2);
    cameras.push_back(test::camera_along({5, 6, 7}, {1, 0.4, -0.3}));  // from within
    std::uint64_t hits = 0;
    for (const Camera &camera : cameras) {
      const auto frames =
          make_level_frames(level_infos(volume, true), camera, kSize, isovalue, voxel_pixels);
      EXPECT_GT(std::ranges::count_if(frames, draws), 1) << "no border is tested";
      const auto expected = twin.render(camera, kSize, isovalue);
      renderer.render({.camera = camera, .isovalue = isovalue, .voxel_pixels = voxel_pixels});
      expect_same_hits(renderer.hits(), expected, kSize.width);
      hits += num_hits(expected);
    }
    return hits;
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, NoDataLevels, testing::ValuesIn(devices_under_test()),
                         device_test_name);

CompressedVolume pyramid_of(const glm::uvec3 &dims, const test::VoxelFunction &field,
                            const Hole &hole) {
  return compressed(dims, with_hole(dims, test::sample(dims, field), hole),
                    {.rate = 12, .levels = 0});
}

TEST_P(NoDataLevels, SmallBandsHaveTheTwinsBits) {
  const glm::uvec3 dims(24, 22, 19);
  std::uint64_t hits = 0;
  for (const auto &field : {test::gyroid_field(9), test::noise_field(5)}) {
    for (const NamedHole &hole : holes(dims)) {
      if (is_llvmpipe(GetParam()) && !long_tests() && hole.name[0] != 's') continue;
      SCOPED_TRACE(hole.name);
      const CompressedVolume volume = pyramid_of(dims, field, hole.hole);
      hits += check(volume, 0.25f, 2.5);
      hits += check(volume, 0.0f, 5.0, StreamPlace::kHost);
    }
  }
  EXPECT_GT(hits, 1000u);
}

/// Where a level ends in cells without data, no side is carried to the next: else each border would
/// be a surface.
TEST_P(NoDataLevels, SmallGapsAtBordersAreNoHits) {
  const glm::uvec3 dims(24, 22, 19);
  for (const NamedHole &hole : holes(dims)) {
    SCOPED_TRACE(hole.name);
    const auto inside = [](const glm::dvec3 &) { return 1; };
    for (const double voxel_pixels : {2.0, 4.0})
      EXPECT_EQ(check(pyramid_of(dims, inside, hole.hole), 0.5f, voxel_pixels), 0u);
  }
}

/// Blocks that are as a whole on one side, of levels that contradict each other, and are without
/// data in other places.
TEST_P(NoDataLevels, SmallSidesOfWholeBlocksNeedData) {
  const glm::uvec3 dims(40, 37, 33);
  const auto ball = [](float inner, float outer) {
    return [=](const glm::dvec3 &at) {
      return glm::distance(at, glm::dvec3(30, 20, 20)) < 9 ? inner : outer;
    };
  };
  const auto in_layers = [](std::uint32_t axis, std::uint32_t period) {
    return [=](const glm::uvec3 &at) {
      return at[static_cast<glm::length_t>(axis)] / (period / 2) % 2 == 0;
    };
  };
  CompressedVolume volume = pyramid_of(dims, ball(1, 0), in_layers(0, 12));
  volume.coarser_levels = pyramid_of(dims, ball(0, 1), in_layers(1, 14)).coarser_levels;
  EXPECT_GT(check(volume, 0.5f, 2.5), 100u);
  const CompressedVolume scattered = pyramid_of(dims, ball(1, 0), holes(dims)[2].hole);
  volume = pyramid_of(dims, ball(0, 1), holes(dims)[0].hole);
  volume.coarser_levels = scattered.coarser_levels;
  EXPECT_GT(check(volume, 0.5f, 2.5), 100u);
}

}  // namespace
}  // namespace isowave::core
