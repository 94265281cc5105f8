// Errors are those against the source in its own type: what float32 cannot hold counts, tiny values
// that become 0 count.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/base/error.hpp"
#include "core/io/open_volume.hpp"
#include "core/sources/generate.hpp"
#include "core/stages/zfp_encode.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "kernels_cl/portable/block_bound.h"
#include "reference/cell_oracle.hpp"
#include "reference/random.hpp"
#include "tests/array_reader.hpp"
#include "tests/run_program.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using test::TemporaryFolder;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr glm::uvec3 kDims(21, 18, 17);
constexpr std::size_t kNumVoxels = std::size_t{kDims.x} * kDims.y * kDims.z;

struct Source {
  std::string name;
  VoxelType type;
  std::function<double(std::size_t)> value;

  ArrayReader reader() const {
    std::vector<double> voxels(kNumVoxels);
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = value(i);
    return {kDims, voxels, type};
  }
};

/// Scattered, but the same for all.
double noise(std::size_t i) {
  return std::ldexp(double((i + 1) * 0x9E3779B97F4A7C15u >> 11), -53);
}

std::vector<Source> sources() {
  return {
      {"float64 ramp at 1e9", VoxelType::kFloat64,
       [](std::size_t i) { return 1e9 + 0.37 * double(i); }},
      {"float64 noise", VoxelType::kFloat64, noise},
      {"float64 below float32", VoxelType::kFloat64,
       [](std::size_t i) { return 1e-50 * (noise(i) - 0.5); }},
      {"float64 denormal floats", VoxelType::kFloat64,
       [](std::size_t i) { return 1e-40 * noise(i); }},
      {"float64 tiny among large", VoxelType::kFloat64,
       [](std::size_t i) { return i % 7 == 0 ? 1e-31 : 1e8 * noise(i); }},
      {"int32 odd ramp beyond 2^24", VoxelType::kInt32,
       [](std::size_t i) { return 16777217.0 + 2 * double(i); }},
      {"int32 around 2^24", VoxelType::kInt32,
       [](std::size_t i) { return 16777216.0 - 3000 + double(i); }},
      {"int32 negative", VoxelType::kInt32,
       [](std::size_t i) { return std::floor(-2147483648.0 + 4e9 * noise(i)); }},
      {"uint32", VoxelType::kUint32,
       [](std::size_t i) { return std::floor(4294967295.0 * noise(i)); }},
      {"float32 tiny", VoxelType::kFloat32,
       [](std::size_t i) { return i % 3 == 0 ? -0.0 : double(1e-35f); }},
      {"float32 some tiny", VoxelType::kFloat32,
       [](std::size_t i) {
         return double(i % 5 == 0 ? 5e-30f : static_cast<float>(1e-29 * noise(i)));
       }},
  };
}

double true_error(const CompressedVolume &volume, const std::vector<double> &source) {
  const std::vector<float> decoded = decode_with_libzfp(volume);
  double error = 0;
  for (std::size_t i = 0; i < source.size(); ++i)
    error = std::max(error, std::abs(double{decoded[i]} - source[i]));
  return error;
}

/// No voxel of a level is farther off than its block's bound says; the finest one's bounds are by
/// place.
void expect_bounds_hold(const CompressedVolume &volume, const std::vector<double> &source) {
  std::uint32_t step = 1;
  const CompressedVolume *level = &volume;
  for (std::size_t number = 0; number <= volume.coarser_levels.size(); ++number, step *= 2) {
    if (number > 0) level = &volume.coarser_levels[number - 1];
    const std::vector<float> decoded = decode_with_libzfp(*level);
    const glm::uvec3 dims = level->info.dims, blocks = level->num_blocks();
    ASSERT_EQ(level->bounds.codes.size(), level->block_count()) << "level " << number;
    const ValueOffset offset{0, std::ldexp(1.0f, level->bounds.exponent)};
    for (std::size_t i = 0; i < decoded.size(); ++i) {
      const glm::uvec3 at(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y), fine = step * at;
      if (glm::any(glm::greaterThanEqual(fine, kDims))) continue;  // behind the volume
      const std::size_t block =
          at.x / 4 + blocks.x * (at.y / 4 + std::size_t{blocks.y} * (at.z / 4));
      const float bound = offset_of_voxel(offset, level->bounds, block,
                                          at.x % 4 + 4 * (at.y % 4) + 16 * (at.z % 4));
      const double exact = source[fine.x + kDims.x * (fine.y + std::size_t{kDims.y} * fine.z)];
      ASSERT_LE(std::abs(double{decoded[i]} - exact), double{bound})
          << "level " << number << ", voxel " << i;
    }
  }
}

TEST(SourceError, OfRatesAndTheirLevels) {
  for (const Source &source : sources()) {
    for (const std::uint32_t rate : {2u, 12u, 32u}) {
      SCOPED_TRACE(fmt::format("{}, rate {}", source.name, rate));
      ArrayReader reader = source.reader();
      const CompressedVolume volume =
          compress(reader, {.rate = rate, .measure_error = true, .levels = 0});
      const double error = true_error(volume, reader.voxels());
      EXPECT_GE(*volume.max_voxel_error, error);
      // The sum of what the cast has lost and of what zfp has, which is at most error + lost. No
      // float32 is closer to a voxel than its cast is, so that lost is at most the error; it is
      // rounded up.
      EXPECT_LE(*volume.max_voxel_error,
                3 * error + double{std::numeric_limits<float>::denorm_min()});
      expect_bounds_hold(volume, reader.voxels());
    }
  }
}

TEST(SourceError, OfTolerancesAndTheirLevels) {
  for (const Source &source : sources()) {
    ArrayReader reader = source.reader();
    const auto [least, largest] = std::ranges::minmax(reader.voxels());
    for (const double part : {1e-1, 1e-4}) {
      const double tolerance = part * std::max(largest - least, 1e-6 * std::abs(largest));
      SCOPED_TRACE(fmt::format("{}, tolerance {}", source.name, tolerance));
      try {
        const BlockPrecision bound = choose_precision(reader, {tolerance}, {});
        const CompressedVolume volume = compress(reader, {.precision = bound, .levels = 0});
        EXPECT_LE(*volume.max_voxel_error, tolerance);
        EXPECT_LE(true_error(volume, reader.voxels()), *volume.max_voxel_error);
        expect_bounds_hold(volume, reader.voxels());
      } catch (const Error &error) {
        EXPECT_THAT(error.what(), HasSubstr("cannot be kept"));
        // The cast and zfp lose 2^-24 each, at most, of the next power of two above the values.
        EXPECT_LT(tolerance,
                  std::max(0x1p-22 * std::max(-least, largest), 2 * double{kMinMagnitude}));
      }
    }
  }
}

/// What a refusal says can be kept, can; and hardly less.
TEST(SourceError, RefusedTolerancesNameTheSmallest) {
  for (const Source &source : sources()) {
    SCOPED_TRACE(source.name);
    ArrayReader reader = source.reader();
    double smallest = 0;
    try {
      choose_precision(reader, {1e-60}, {});
      ADD_FAILURE() << "1e-60 was kept";
    } catch (const Error &error) {
      const std::string text = error.what(), before = "off by up to ";
      ASSERT_NE(text.find(before), std::string::npos) << text;
      smallest = std::stod(text.substr(text.find(before) + before.size()));
    }
    const BlockPrecision bound = choose_precision(reader, {smallest}, {});
    const CompressedVolume volume = compress(reader, {.precision = bound});
    EXPECT_LE(true_error(volume, reader.voxels()), smallest);
    EXPECT_THROW(choose_precision(reader, {0.9 * smallest}, {}), Error);
    double lost = 0;
    for (const double value : reader.voxels())
      lost = std::max(lost, std::abs(value - double(float(value))));
    EXPECT_GE(smallest, lost) << "no float32 is closer";
  }
}

TEST(SourceError, IntegersThatFloat32HoldsAreExactTo2To24) {
  const auto range = [](double first) {
    std::vector<double> voxels(kNumVoxels);
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = first - double(i);
    return ArrayReader(kDims, voxels, VoxelType::kInt32);
  };
  ArrayReader below = range(16777215), at = range(16777216), above = range(16777217);
  EXPECT_TRUE(choose_precision(below, {.exact = true}, {}).whole_numbers);
  EXPECT_TRUE(choose_precision(at, {.exact = true}, {}).is_reversible());
  EXPECT_THAT([&] { choose_precision(above, {.exact = true}, {}); },
              ThrowsMessage<Error>(HasSubstr("off by up to 1:")));
}

TEST(SourceError, AMappedVoxelsSourceIsWhatItIsMappedTo) {
  for (const float map_nan : {3.0f, 1e-35f}) {
    std::vector<double> voxels(kNumVoxels, 1.0), expected = voxels;
    for (std::size_t i = 0; i < voxels.size(); i += 50) {
      voxels[i] = i % 100 == 0 ? double{NAN} : -double{INFINITY};
      expected[i] = double{map_nan};
    }
    for (const VoxelType type : {VoxelType::kFloat64, VoxelType::kFloat32}) {
      ArrayReader reader(kDims, voxels, type);
      const CompressedVolume volume =
          compress(reader, {.rate = 32, .measure_error = true, .input = {.map_nan = map_nan}});
      const double error = true_error(volume, expected);
      EXPECT_GE(*volume.max_voxel_error, error);
      EXPECT_LE(*volume.max_voxel_error, 3 * error);
    }
  }
}

/// A finite number is not mapped, however large.
TEST(SourceError, DoublesBeyondFloat32AreRefused) {
  for (const double large : {1e300, -1e39, 0x1p126, std::nextafter(0x1p126, 0.0)}) {
    std::vector<double> voxels(kNumVoxels, 1.0);
    voxels[12] = large;
    ArrayReader reader(kDims, voxels, VoxelType::kFloat64);
    EXPECT_THAT([&] { compress(reader, {.rate = 8, .input = {.map_nan = 0.0f}}); },
                ThrowsMessage<Error>(HasSubstr("1 of 6426 voxels is beyond")));
  }
}

TEST(SourceError, RangesAreOfFloatsAndOfTheSource) {
  ArrayReader reader(kDims, std::vector<double>(kNumVoxels, 16777217), VoxelType::kInt32);
  ChunkCoder nothing;
  const ValueRange range = read_in_chunks(reader, {}, nothing);
  EXPECT_EQ(range.coded, (std::array{16777216.0f, 16777216.0f}));
  EXPECT_EQ(range.source, (std::array{16777217.0, 16777217.0}));
  for (const VoxelType type : {VoxelType::kFloat32, VoxelType::kFloat64}) {
    ArrayReader tiny(kDims, std::vector<double>(kNumVoxels, double{1e-35f}), type);
    EXPECT_EQ(read_in_chunks(tiny, {}, nothing).coded, (std::array{1e-35f, 1e-35f}))
        << "before it becomes 0, whatever the type";
  }
}

/// Values that one float32 stands for are apart.
TEST(SourceError, TheCellOracleSeesDoubles) {
  std::vector<double> voxels;
  for (int i = 0; i < 27; ++i) voxels.push_back(1e9 + i % 3);
  const CellOracle oracle(voxels, {3, 3, 3}, 1e9f);
  EXPECT_EQ(oracle.field({1.5, 1, 1}), 1e9 + 1.5);
  EXPECT_EQ(CellOracle(std::span<const double>(voxels), {3, 3, 3}, 1e9f).num_cells(), 0u);
}

/// Readers hand over what their files have.
TEST(SourceError, FilesAreReadExactly) {
  const TemporaryFolder folder;
  std::vector<std::int32_t> integers(60);
  std::vector<double> doubles(60);
  for (int i = 0; i < 60; ++i)
    integers[std::size_t(i)] = 2147483647 - i, doubles[std::size_t(i)] = 1 + 1e-12 * i;
  test::write_file(folder / "i_3x4x5_int32.raw", integers);
  test::write_file(folder / "d_3x4x5_float64.raw", doubles);
  const auto with_header = [](const std::string &header, const auto &values) {
    return header + std::string(reinterpret_cast<const char *>(values.data()),
                                values.size() * sizeof(values[0]));
  };
  test::write_file(folder / "i.nrrd",
                   with_header("NRRD0004\ntype: int\ndimension: 3\nsizes: 3 4 5\nendian: little\n"
                               "encoding: raw\n\n",
                               integers));
  test::write_file(folder / "d.mha",
                   with_header("ObjectType = Image\nNDims = 3\nBinaryData = True\n"
                               "BinaryDataByteOrderMSB = False\nDimSize = 3 4 5\n"
                               "ElementType = MET_DOUBLE\nElementDataFile = LOCAL\n",
                               doubles));
  for (const std::string name : {"i_3x4x5_int32.raw", "d_3x4x5_float64.raw", "i.nrrd", "d.mha"}) {
    SCOPED_TRACE(name);
    const auto reader = open_volume(folder / name);
    std::vector<double> got(60);
    reader->read_exact_layers(0, 2, std::span(got).first(24));
    reader->read_exact_layers(2, 3, std::span(got).subspan(24));
    if (name[0] == 'i') {
      EXPECT_TRUE(std::ranges::equal(got, integers));
    } else {
      EXPECT_EQ(got, doubles);
    }
  }
  const auto generated =
      open_generated({.field = Field::kSphere, .dims = kDims, .type = VoxelType::kFloat64});
  std::vector<double> exact(kNumVoxels);
  std::vector<float> casts(kNumVoxels);
  generated->read_exact_layers(0, kDims.z, exact);
  generated->read_layers(0, kDims.z, casts);
  EXPECT_FALSE(std::ranges::equal(exact, casts));
  EXPECT_TRUE(std::ranges::equal(exact, casts,
                                 [](double a, float b) { return static_cast<float>(a) == b; }));
}

// ---- the program

TEST(SourceErrorOfTheProgram, RelativeTolerancesAreOfTheSourcesRange) {
  const TemporaryFolder folder;
  std::vector<double> voxels(kNumVoxels);
  for (std::size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = 1e9 + 10 * noise(i);  // one float32 or two
  const auto path = folder / "a_21x18x17_float64.raw";
  test::write_file(path, voxels);
  const std::string out = test::quoted(folder / "a.zfp");
  test::expect_one_line_error(
      "convert " + test::quoted(path) + " --tolerance-relative 0.1 -o " + out,
      "cannot be kept: voxels are stored as float32");
  EXPECT_EQ(
      test::run_isowave("convert " + test::quoted(path) + " --tolerance-relative 1.1 -o " + out)
          .status,
      0);
  const auto info = test::run_isowave("info --json " + test::quoted(path));
  EXPECT_EQ(info.out.find("1000000000.0,"), std::string::npos) << info.out;
}

TEST(SourceErrorOfTheProgram, TolerancesMayBeAsLargeAsNumbersAre) {
  const TemporaryFolder folder;
  const auto path = folder / "a.zfp";
  for (const std::string tolerance : {"1e38", "1e39", "1e200", "1.7e308"}) {
    const auto run = test::run_isowave("convert generate:gyroid_21x18x17_float32 --levels 2 -o " +
                                       test::quoted(path) + " --tolerance " + tolerance);
    EXPECT_EQ(run.status, 0) << tolerance << run.err;
    EXPECT_LE(*known_voxel_error(open_zfp_file(path)), std::stod(tolerance));
  }
}

TEST(SourceErrorOfTheProgram, PrintedErrorsAreNotBelow) {
  const TemporaryFolder folder;
  ArrayReader reader = sources()[0].reader();
  const auto path = folder / "a_21x18x17_float64.raw", out = folder / "a.zfp";
  test::write_file(path, reader.voxels());
  const auto run =
      test::run_isowave("convert " + test::quoted(path) + " --rate 32 -o " + test::quoted(out));
  ASSERT_EQ(run.status, 0) << run.err;
  const std::string before = "max error ";
  const double printed = std::stod(run.out.substr(run.out.find(before) + before.size()));
  EXPECT_GE(printed, true_error(read_zfp_file(out), reader.voxels()));
}

/// Rays are judged against the doubles, at an isovalue between which float32 has few values.
TEST(SourceErrorOfTheProgram, VerifyComparesWithTheSource) {
  const TemporaryFolder folder;
  std::vector<double> voxels(kNumVoxels);
  for (std::size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = 1e7 + double(i % kDims.x) + 0.31 * double(i / kDims.x % kDims.y);
  const auto path = folder / "a_21x18x17_float64.raw";
  test::write_file(path, voxels);
  const auto run = test::run_isowave(
      "verify " + test::quoted(path) +
      " -i 10000012 --device cpu --size 48x32 --orbit 2 --tolerance 0.75 --max-surface-error 4");
  EXPECT_EQ(run.status, 0) << run.out << run.err;
}

// ---- the device

class SourceErrorOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {};
INSTANTIATE_TEST_SUITE_P(Devices, SourceErrorOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(SourceErrorOnDevice, SmallErrorsAreTheHosts) {
  ocl::Device device(GetParam());
  for (const Source &source : sources()) {
    SCOPED_TRACE(source.name);
    ArrayReader reader = source.reader();
    CompressOptions options{.rate = 7, .measure_error = true, .levels = 0};
    const CompressedVolume host = compress(reader, options);
    options.encoder = encoder_on(device);
    const CompressedVolume got = compress(reader, options);
    EXPECT_EQ(got.words, host.words);
    EXPECT_EQ(got.max_voxel_error, host.max_voxel_error);
    EXPECT_EQ(got.bounds.codes, host.bounds.codes);
    for (std::size_t level = 0; level < host.coarser_levels.size(); ++level)
      EXPECT_EQ(got.coarser_levels[level].bounds.codes, host.coarser_levels[level].bounds.codes);
    if (is_simulator(device.info())) break;  // the kernels are those of every source
  }
}

}  // namespace
}  // namespace isowave::core
