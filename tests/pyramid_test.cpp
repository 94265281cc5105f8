// Levels of detail: their voxels against a plain triple loop, and volumes that have them in memory
// and in files.

#include "core/volume/pyramid.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/base/error.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "tests/frame_scene.hpp"
#include "tests/run_program.hpp"
#include "tests/zfp_trailer_file.hpp"

namespace isowave::core {
namespace {

using test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// The definition, one voxel at a time: weights -1, 4, 10, 4, -1 along each axis, held to the
/// values, and copies of the border. NaN: without data.
std::vector<float> plain_downsample(const glm::ivec3 &dims, const std::vector<float> &voxels) {
  const auto weighted = [](auto &&value_at, int k) {
    std::array values{value_at(2 * k - 2), value_at(2 * k - 1), value_at(2 * k),
                      value_at(2 * k + 1), value_at(2 * k + 2)};
    const auto fill = [&](std::size_t i, double value) {
      if (std::isnan(values.at(i))) values.at(i) = value;
    };
    fill(2, (values[1] + values[3]) / 2);
    if (std::isnan(values[2])) return values[2];
    for (const std::size_t i : {1u, 3u}) fill(i, values[2]);
    for (const std::size_t i : {0u, 4u}) fill(i, values.at(i == 0 ? 1 : 3));
    const double sum = -values[0] + 4 * values[1] + 10 * values[2] + 4 * values[3] - values[4];
    return std::clamp(sum / 16, std::ranges::min(values), std::ranges::max(values));
  };
  const auto fine = [&](int x, int y, int z) {
    const glm::ivec3 at = glm::clamp(glm::ivec3(x, y, z), glm::ivec3(0), dims - 1);
    return double(voxels[std::size_t(at.x + dims.x * (at.y + dims.y * at.z))]);
  };
  std::vector<float> coarse;
  for (int z = 0; z <= dims.z / 2; ++z) {
    for (int y = 0; y <= dims.y / 2; ++y) {
      for (int x = 0; x <= dims.x / 2; ++x) {
        const auto along_y = [&](int fx, int fz) {
          return weighted([&](int fy) { return fine(fx, fy, fz); }, y);
        };
        const auto along_x = [&](int fz) {
          return weighted([&](int fx) { return along_y(fx, fz); }, x);
        };
        coarse.push_back(float(weighted(along_x, z)));
      }
    }
  }
  return coarse;
}

/// Multiples of 1/8 below 2^8: every voxel of the next level is exact in float, in whatever order
/// it is summed.
std::vector<float> exact_voxels(const glm::uvec3 &dims, std::uint32_t seed = 5) {
  std::mt19937 random(seed);
  std::vector<float> voxels(std::size_t{dims.x} * dims.y * dims.z);
  for (float &voxel : voxels) voxel = float(random() % 2048) / 8.0f - 100.0f;
  return voxels;
}

const std::vector<glm::uvec3> kDims{{8, 8, 8}, {9, 8, 11}, {16, 21, 13}, {31, 8, 40}, {64, 12, 9}};

TEST(Pyramid, VoxelsAreMeansOfFinerOnes) {
  for (const glm::uvec3 &dims : kDims) {
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    const std::vector<float> voxels = exact_voxels(dims);
    EXPECT_EQ(downsample(dims, voxels), plain_downsample(dims, voxels));
  }
}

TEST(Pyramid, VoxelsWithoutDataAreLeftOut) {
  for (const glm::uvec3 &dims : kDims) {
    for (const std::uint32_t share : {2u, 3u, 20u}) {
      SCOPED_TRACE(fmt::format("{}x{}x{}, one of {}", dims.x, dims.y, dims.z, share));
      std::vector<float> voxels = exact_voxels(dims);
      std::mt19937 random(share);
      for (float &voxel : voxels) {
        if (random() % share == 0) voxel = std::numeric_limits<float>::quiet_NaN();
      }
      const std::vector<float> got = downsample(dims, voxels),
                               expected = plain_downsample(dims, voxels);
      ASSERT_EQ(got.size(), expected.size());
      for (std::size_t i = 0; i < got.size(); ++i) {
        ASSERT_EQ(std::isnan(got[i]), std::isnan(expected[i])) << i;
        ASSERT_TRUE(std::isnan(got[i]) || std::abs(got[i] - expected[i]) < 1e-4) << i;
      }
    }
  }
}

/// Where a field bends evenly, voxels keep their values; means of positive weights would move every
/// surface.
TEST(Pyramid, SmoothFieldsStayWhereTheyAre) {
  const glm::uvec3 dims{33, 33, 33};
  const std::vector<float> fine =
      test::sample(dims, [](const glm::dvec3 &p) { return 0.01 * glm::dot(p, p); });
  const std::vector<float> coarse = downsample(dims, fine);
  for (std::size_t k = 1; k < 16; ++k)
    EXPECT_NEAR(coarse[k + 17 * (8 + 17 * 8)], fine[2 * (k + 33 * (8 + 33 * 8))], 1e-4) << k;
}

TEST(Pyramid, StepsDoNotRing) {
  const glm::uvec3 dims{20, 9, 12};
  const std::vector<float> coarse = downsample(
      dims, test::sample(dims, [](const glm::dvec3 &p) { return p.x < 8.5 ? -3e38 : 3e38; }));
  for (const float value : coarse) EXPECT_LE(std::abs(value), 3e38f);
}

TEST(Pyramid, AnyPiecesAndThreadsGiveTheSameVoxels) {
  const glm::uvec3 dims{21, 10, 30};
  const std::vector<float> voxels = test::sample(dims, test::noise_field(3));
  const std::vector<float> expected = downsample(dims, voxels);
  for (const std::uint32_t piece : {1u, 2u, 3u, 4u, 29u}) {
    for (const std::uint32_t threads : {1u, 3u}) {
      std::vector<float> coarse;
      std::uint32_t next = 0;
      Downsampler downsampler(dims, threads, [&](const Chunk &chunk) {
        EXPECT_EQ(chunk.z, next);
        next += chunk.num_layers;
        coarse.insert(coarse.end(), chunk.voxels.begin(), chunk.voxels.end());
      });
      const std::size_t layer = std::size_t{dims.x} * dims.y;
      for (std::uint32_t z = 0; z < dims.z; z += piece) {
        downsampler.add(std::span(voxels).subspan(z * layer, std::min(piece, dims.z - z) * layer));
      }
      EXPECT_EQ(coarse, expected) << piece << " layers at a time, " << threads << " threads";
    }
  }
}

TEST(Pyramid, GridsCoverTheFineOne) {
  VolumeInfo info = test::grid_info({100, 17, 9}, {1, 2, 0.5});
  info.type = VoxelType::kUint8;
  info.origin = {3, 4, 5};
  const VolumeInfo coarse = coarser_level(info);
  EXPECT_EQ(coarse.dims, glm::uvec3(51, 9, 5));
  EXPECT_EQ(coarse.spacing, glm::dvec3(2, 4, 1));
  EXPECT_EQ(coarse.origin, info.origin);
  EXPECT_EQ(coarse.type, VoxelType::kFloat32);
  EXPECT_EQ(max_levels({2048, 2048, 1920}), 10u);
  EXPECT_EQ(max_levels({100, 17, 9}), 2u);
  EXPECT_EQ(max_levels({100, 100, 7}), 1u);
}

TEST(Pyramid, LevelsAreTheVolumesOfTheirVoxels) {
  for (const glm::uvec3 &dims : kDims) {
    const std::vector<float> voxels = exact_voxels(dims);
    ArrayReader reader(test::grid_info(dims, {1, 2, 3}), voxels);
    const CompressedVolume volume = compress(reader, {.rate = 11, .levels = 0});
    ASSERT_EQ(volume.coarser_levels.size() + 1, max_levels(dims));
    std::vector<float> finer = voxels;
    glm::uvec3 finer_dims = dims;
    for (const CompressedVolume &level : volume.coarser_levels) {
      finer = downsample(finer_dims, finer);
      finer_dims = level.info.dims;
      ArrayReader alone(level.info, finer);
      const CompressedVolume expected = compress(alone, {.rate = 11});
      EXPECT_EQ(level.words, expected.words);
      EXPECT_EQ(level.info.dims, expected.info.dims);
      EXPECT_EQ(level.info.spacing,
                glm::dvec3(1, 2, 3) * double(1 << (&level - volume.coarser_levels.data() + 1)));
    }
  }
}

TEST(Pyramid, LevelsOfAnExactVolumeAreNoIntegers) {
  const glm::uvec3 dims{20, 20, 20};
  VolumeInfo info = test::grid_info(dims);
  info.type = VoxelType::kUint8;
  ArrayReader reader(info, test::sample(dims, test::plateau_field()));
  const BlockPrecision bound = choose_precision(reader, {.exact = true}, {});
  const CompressedVolume volume = compress(reader, {.precision = bound, .levels = 0});
  EXPECT_TRUE(volume.precision.whole_numbers);
  const std::vector<float> exact = downsample(dims, decode_with_libzfp(volume));
  const std::vector<float> got = decode_with_libzfp(volume.coarser_levels.at(0));
  ASSERT_EQ(got.size(), exact.size());
  float largest = 0, farthest_from_whole = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    largest = std::max(largest, std::abs(got[i] - exact[i]));
    farthest_from_whole = std::max(farthest_from_whole, std::abs(got[i] - std::rint(got[i])));
  }
  EXPECT_LE(largest, 2.0f);  // as coarse as the volume's planes are, before rounding
  EXPECT_GT(farthest_from_whole, 0.1f);
}

class PyramidFile : public testing::Test {
 protected:
  CompressedVolume write(const CompressOptions &options) {
    ArrayReader reader(test::grid_info({30, 19, 24}, {1, 2, 3}),
                       test::sample({30, 19, 24}, test::gyroid_field(9)));
    compress_to_file(reader, options, folder_ / "a.zfp");
    return compress(reader, options);
  }
  void expect_refused(const std::string &bytes, const std::string &message) {
    test::write_file(folder_ / "b.zfp", bytes);
    EXPECT_THAT([&] { read_zfp_file(folder_ / "b.zfp"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("b.zfp"), HasSubstr(message))));
  }
  TemporaryFolder folder_;
};

TEST_F(PyramidFile, EveryLevelComesBack) {
  for (const CompressOptions &options :
       {CompressOptions{.rate = 5, .levels = 3},
        CompressOptions{.rate = 7, .measure_error = true, .levels = 3},
        CompressOptions{.precision = BlockPrecision{.min_exponent = -8}, .levels = 0}}) {
    const CompressedVolume expected = write(options);
    const bool measured = options.measure_error || options.precision;
    const auto check_bounds = [&](const CompressedVolume &got, const CompressedVolume &level) {
      EXPECT_EQ(level.bounds.codes.size(), measured ? level.block_count() : 0);
      EXPECT_EQ(got.bounds.codes, level.bounds.codes);
      EXPECT_EQ(got.bounds.exponent, level.bounds.exponent);
      if (measured) {
        EXPECT_EQ(got.bounds.by_place, &level == &expected);
        EXPECT_EQ(level.bounds.by_place, &level == &expected);
      }
    };
    const auto check = [&](const CompressedVolume &got, bool payload) {
      ASSERT_EQ(got.coarser_levels.size(), expected.coarser_levels.size());
      if (payload) check_bounds(got, expected);
      for (std::size_t i = 0; i < got.coarser_levels.size(); ++i) {
        const CompressedVolume &level = got.coarser_levels[i];
        EXPECT_EQ(level.info.dims, expected.coarser_levels[i].info.dims);
        EXPECT_EQ(level.info.spacing, expected.coarser_levels[i].info.spacing);
        if (!payload) continue;
        check_bounds(level, expected.coarser_levels[i]);
        EXPECT_EQ(level.index, expected.coarser_levels[i].index);
        EXPECT_EQ(decode_with_libzfp(level), decode_with_libzfp(expected.coarser_levels[i]));
      }
    };
    check(read_zfp_file(folder_ / "a.zfp"), true);
    check(open_zfp_file(folder_ / "a.zfp"), true);
    check(read_zfp_file_info(folder_ / "a.zfp"), false);
    CompressedVolume respaced = read_zfp_file_info(folder_ / "a.zfp");
    set_spacing(respaced, {5, 6, 7});
    EXPECT_EQ(respaced.coarser_levels.at(1).info.spacing, glm::dvec3(20, 24, 28));
  }
}

/// Bounds whose shares this program does not know are those of whole blocks, which hold as well.
TEST_F(PyramidFile, BoundsByAnotherRuleAreOfBlocks) {
  const CompressedVolume volume = write({.rate = 7, .measure_error = true, .levels = 2});
  test::TrailerFile file(test::read_file(folder_ / "a.zfp"));
  EXPECT_TRUE(read_zfp_file(folder_ / "a.zfp").bounds.by_place);
  const std::string field = "\"bounds_by_place\":";
  const std::size_t at = file.text.find(field) + field.size();
  ASSERT_EQ(file.text.at(at), '2');
  file.text[at] = '3';
  test::write_file(folder_ / "b.zfp", file.bytes());
  const CompressedVolume got = read_zfp_file(folder_ / "b.zfp");
  EXPECT_FALSE(got.bounds.by_place);
  EXPECT_EQ(got.bounds.codes, volume.bounds.codes);
}

TEST_F(PyramidFile, BeginsAsTheVolumeWithoutLevels) {
  write({.rate = 6, .levels = 0});
  const std::string with = test::read_file(folder_ / "a.zfp");
  const CompressedVolume alone = write({.rate = 6});
  const std::size_t stream_bytes = 12 + alone.payload_bits() / 8;
  EXPECT_EQ(with.substr(0, stream_bytes),
            test::read_file(folder_ / "a.zfp").substr(0, stream_bytes));
}

TEST_F(PyramidFile, DamageIsFound) {
  const CompressedVolume volume = write({.rate = 4, .levels = 2});
  const std::string good = test::read_file(folder_ / "a.zfp");
  for (std::size_t cut = 0; cut < good.size(); cut += 97) {
    test::write_file(folder_ / "b.zfp", good.substr(0, cut));
    EXPECT_THROW(read_zfp_file(folder_ / "b.zfp"), Error) << cut;
  }
  std::string damaged = good;
  const std::size_t level_begin = (12 + volume.payload_bits() / 8 + 7) / 8 * 8;
  damaged[level_begin + 100] ^= 1;  // within the level's payload
  expect_refused(damaged, "checksum");
  damaged = good;
  damaged[level_begin + 5] ^= 1;  // its header
  test::write_file(folder_ / "b.zfp", damaged);
  EXPECT_THROW(read_zfp_file(folder_ / "b.zfp"), Error);
}

TEST_F(PyramidFile, TooManyLevelsAreRefusedAndNothingIsLeft) {
  EXPECT_THAT([&] { write({.rate = 4, .levels = 4}); },
              ThrowsMessage<Error>(AllOf(HasSubstr("4 levels of detail"), HasSubstr("1 to 3"))));
  ArrayReader bad(test::grid_info({30, 19, 24}), std::vector<float>(30 * 19 * 24, INFINITY));
  EXPECT_THROW(compress_to_file(bad, {.rate = 4, .levels = 0}, folder_ / "a.zfp"), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / ""));
}

}  // namespace
}  // namespace isowave::core
