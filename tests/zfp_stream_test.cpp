// Compression against libzfp on the whole array, zfp's own tool, and files by other writers.

#include "core/zfp/zfp_stream.hpp"
#include "core/io/open_volume.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zfp.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "core/base/error.hpp"
#include "core/sources/load_volume.hpp"
#include "tests/array_reader.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::TemporaryFolder;
using test::write_file;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// Smooth with noise on top, so that blocks differ in exponent and in how many bits they would
/// like.
std::vector<float> wavy(const glm::uvec3 &dims, std::uint32_t seed = 1) {
  std::mt19937 random(seed);
  std::vector<float> voxels;
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x) {
        const double smooth =
            std::sin(0.3 * x) * std::cos(0.2 * y + 0.1 * z) * std::exp2(double(x / 8) - 4);
        voxels.push_back(float(smooth + 1e-3 * double(random() % 1000)));
      }
    }
  }
  return voxels;
}

/// A whole array compressed by one call of libzfp, with zfp's full header.
std::string zfp_file(std::vector<float> &voxels, const glm::uvec3 &dims,
                     std::uint32_t bits_per_block) {
  zfp_stream *stream = zfp_stream_open(nullptr);
  zfp_stream_set_params(stream, bits_per_block, bits_per_block, ZFP_MAX_PREC, ZFP_MIN_EXP);
  zfp_field *field = zfp_field_3d(voxels.data(), zfp_type_float, dims.x, dims.y, dims.z);
  std::string bytes(zfp_stream_maximum_size(stream, field) + 64, '\0');
  bitstream *bits = stream_open(bytes.data(), bytes.size());
  zfp_stream_set_bit_stream(stream, bits);
  zfp_write_header(stream, field, ZFP_HEADER_FULL);
  bytes.resize(zfp_compress(stream, field));
  stream_close(bits);
  zfp_field_free(field);
  zfp_stream_close(stream);
  return bytes;
}

const std::vector<glm::uvec3> kDims{{2, 2, 2},    {4, 4, 4},   {5, 7, 9},
                                    {64, 33, 18}, {3, 130, 2}, {41, 2, 41}};

TEST(Compress, SameBytesAsLibzfpOnTheWholeArray) {
  for (const glm::uvec3 &dims : kDims) {
    for (const std::uint32_t rate : {1u, 2u, 3u, 8u, 17u, 32u}) {
      SCOPED_TRACE(fmt::format("{}x{}x{} rate {}", dims.x, dims.y, dims.z, rate));
      const TemporaryFolder folder;
      std::vector<float> voxels = wavy(dims);
      ArrayReader reader(dims, voxels);
      CompressOptions options;
      options.rate = rate;
      compress_to_file(reader, options, folder / "a.zfp");
      const std::string expected = zfp_file(voxels, dims, 64 * rate);
      EXPECT_EQ(test::read_file(folder / "a.zfp").substr(0, expected.size()), expected);

      const CompressedVolume in_memory = compress(reader, options);
      const CompressedVolume from_file = read_zfp_file(folder / "a.zfp");
      EXPECT_EQ(in_memory.words, from_file.words);
      ASSERT_EQ(in_memory.words.size(), in_memory.block_count() * 2 * rate + 2);
      EXPECT_EQ(std::memcmp(in_memory.words.data(), expected.data() + 12,
                            8 * rate * in_memory.block_count()),
                0);
    }
  }
}

TEST(Compress, ManyChunksAndAnyThreadCount) {
  const glm::uvec3 dims(700, 701, 19);  // more than one chunk of layers
  const std::vector<float> voxels = wavy(dims);
  ArrayReader reader(dims, voxels);
  CompressOptions options;
  options.rate = 2;
  options.measure_error = true;
  options.input.num_threads = 1;
  std::vector<std::uint32_t> steps;
  options.input.progress = [&](std::uint32_t done, std::uint32_t total) {
    EXPECT_EQ(total, 19u);
    steps.push_back(done);
  };
  const CompressedVolume one = compress(reader, options);
  EXPECT_GT(steps.size(), 1u);
  EXPECT_EQ(steps.back(), 19u);
  options.input.num_threads = 5;
  const CompressedVolume five = compress(reader, options);
  EXPECT_EQ(one.words, five.words);
  EXPECT_EQ(one.max_voxel_error, five.max_voxel_error);

  const std::vector<float> decoded = decode_with_libzfp(one);
  double max_error = 0;
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    max_error = std::max(max_error, std::abs(double(decoded[i]) - double(voxels[i])));
  }
  EXPECT_EQ(one.max_voxel_error, max_error);
  EXPECT_EQ(one.value_range[0], *std::min_element(voxels.begin(), voxels.end()));
  EXPECT_EQ(one.value_range[1], *std::max_element(voxels.begin(), voxels.end()));
}

TEST(ZfpFile, ZfpsOwnToolDecodesIt) {
  for (const std::uint32_t rate : {1u, 2u, 4u, 8u, 16u, 32u}) {
    const TemporaryFolder folder;
    const auto reader = open_volume(ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz");
    CompressOptions options;
    options.rate = rate;
    compress_to_file(*reader, options, folder / "a.zfp");
    const auto run = test::run_command(fmt::format(
        "zfp -q -h -z '{}' -o '{}'", (folder / "a.zfp").string(), (folder / "a.f32").string()));
    ASSERT_EQ(run.status, 0) << run.err;
    const std::vector<float> ours = decode_with_libzfp(read_zfp_file(folder / "a.zfp"));
    const std::string theirs = test::read_file(folder / "a.f32");
    ASSERT_EQ(theirs.size(), ours.size() * sizeof(float));
    EXPECT_EQ(std::memcmp(theirs.data(), ours.data(), theirs.size()), 0) << "rate " << rate;
  }
}

TEST(ZfpFile, KeepsWhatZfpCannotSay) {
  const TemporaryFolder folder;
  std::vector<float> whole = wavy({5, 6, 7});
  for (float &voxel : whole) voxel = std::rint(100 * voxel);
  ArrayReader reader({5, 6, 7}, whole);
  VolumeInfo &info = reader.mutable_info();
  info.spacing = {0.1, 2.0 / 3.0, 1e-7};
  info.origin = {-1e9, 0.3, 5};
  info.direction = glm::dmat3(0, 1, 0, -1, 0, 0, 0, 0, -1);
  info.type = VoxelType::kInt16;
  CompressOptions options{.rate = 8};
  options.measure_error = true;
  const CompressedVolume written = compress_to_file(reader, options, folder / "a.zfp");
  EXPECT_TRUE(written.words.empty());
  EXPECT_EQ(folder.num_files(), 1u);
  for (const CompressedVolume &read :
       {read_zfp_file(folder / "a.zfp"), read_zfp_file_info(folder / "a.zfp")}) {
    EXPECT_EQ(read.info.dims, info.dims);
    EXPECT_EQ(read.info.spacing, info.spacing);
    EXPECT_EQ(read.info.origin, info.origin);
    EXPECT_EQ(read.info.direction, info.direction);
    EXPECT_EQ(read.info.type, info.type);
    EXPECT_EQ(read.bits_per_block, 512u);
    EXPECT_EQ(read.value_range, written.value_range);
    EXPECT_EQ(read.max_voxel_error, written.max_voxel_error);
    EXPECT_TRUE(read.max_voxel_error);
  }
  EXPECT_TRUE(read_zfp_file_info(folder / "a.zfp").words.empty());
}

TEST(Compress, InfAreCountedAndNanMappedOrWithoutData) {
  const TemporaryFolder folder;
  const glm::uvec3 dims(600, 600, 13);  // the last bad voxel is in another chunk than the first
  std::vector<float> voxels(std::size_t(600) * 600 * 13, 1.0f);
  voxels[(2 * 600 + 5) * 600 + 7] = std::numeric_limits<float>::quiet_NaN();
  voxels[(2 * 600 + 9) * 600 + 3] = std::numeric_limits<float>::infinity();
  voxels.back() = -std::numeric_limits<float>::infinity();
  ArrayReader reader(dims, voxels);
  CompressOptions options{.rate = 8};
  EXPECT_THAT(
      [&] { compress_to_file(reader, options, folder / "a.zfp"); },
      ThrowsMessage<Error>(AllOf(HasSubstr("2 of 4680000 voxels"), HasSubstr("x=3, y=9, z=2"))));
  EXPECT_EQ(folder.num_files(), 0u);
  options.input.map_nan = -2.0f;
  options.rate = 32;
  const CompressedVolume mapped = compress(reader, options);
  EXPECT_EQ(mapped.value_range, (std::array{-2.0f, 1.0f}));
  EXPECT_NEAR(decode_with_libzfp(mapped).back(), -2.0f, 1e-6);
  options.input.map_nan = NAN;
  EXPECT_THROW(compress(reader, options), Error);
}

TEST(Compress, MagnitudesThatZfpCannotHold) {
  const glm::uvec3 dims(8, 8, 8);
  std::vector<float> voxels(512, 0.0f);
  CompressOptions options{.rate = 8};
  for (const float large : {kMaxMagnitude, -kMaxMagnitude, std::numeric_limits<float>::max()}) {
    voxels[9] = large;
    ArrayReader reader(dims, voxels);
    EXPECT_THAT(
        [&] { compress(reader, options); },
        ThrowsMessage<Error>(AllOf(HasSubstr("1 of 512 voxels"), HasSubstr("x=1, y=1, z=0"))));
  }
  // Largest and smallest allowed magnitudes of either sign at random: decoded, all finite and none
  // denormal.
  std::mt19937 random(7);
  for (const float scale :
       {std::nextafter(kMaxMagnitude, 0.0f), kMinMagnitude, std::nextafter(kMinMagnitude, 0.0f),
        std::numeric_limits<float>::denorm_min()}) {
    for (float &voxel : voxels) voxel = random() % 2 == 0 ? scale : -scale;
    ArrayReader reader(dims, voxels);
    for (options.rate = 1; options.rate <= 32; ++options.rate) {
      for (const float value : decode_with_libzfp(compress(reader, options))) {
        EXPECT_TRUE(std::isnormal(value) || value == 0.0f) << value << " at rate " << options.rate;
      }
    }
  }
}

TEST(Compress, ValuesThatFloat32DoesNotHoldAreRefused) {
  const auto expect_refused = [](double scale, VoxelType type, const Storage &storage,
                                 const char *text) {
    std::vector<double> voxels(512);
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = scale * (1.0 + double(i % 8));
    const auto open = [&] { return std::make_unique<ArrayReader>(glm::uvec3(8), voxels, type); };
    EXPECT_THAT([&] { compress_volume(open, "a volume", storage); },
                ThrowsMessage<Error>(HasSubstr(text)));
  };
  for (const double scale : {1e-60, -1e-60, 1e-310})
    expect_refused(scale, VoxelType::kFloat64, {}, "float32 holds them within");
  for (const Storage &storage : {Storage{}, {.rate = 8}, {.tolerance = 1e-3}, {.exact = true}}) {
    const char *text = "512 of 512 voxels are beyond +-8.507e+37";
    for (const double scale : {1e60, -1e60, 1e39})
      expect_refused(scale, VoxelType::kFloat64, storage, text);
    expect_refused(0x1.8p124, VoxelType::kFloat32, storage, "scale the volume down");
  }
}

TEST(Compress, RangeOfValuesThatNeedAndNeedNoLook) {
  CompressOptions options{.rate = 8};
  options.input.map_nan = 5.0f;
  for (const float other :
       {-0.0f, 1e-40f, -1e-40f, std::numeric_limits<float>::infinity(), -3.0f}) {
    for (const float most : {0.0f, -0.0f, 2.0f}) {
      std::vector<float> voxels(64 * 8, most);
      voxels[77] = other;
      ArrayReader reader({8, 8, 8}, voxels);
      const float mapped = std::isfinite(other) ? other : 5.0f;
      const auto range = compress(reader, options).value_range;
      EXPECT_EQ(range, (std::array{std::min(most, mapped), std::max(most, mapped)}));
      EXPECT_FALSE(range[0] == 0.0f && std::signbit(range[0]))
          << "a range does not depend on the order of zeros";
      EXPECT_FALSE(range[1] == 0.0f && std::signbit(range[1]));
    }
  }
}

TEST(Compress, RatesOutsideOneTo32) {
  ArrayReader reader({4, 4, 4}, std::vector<float>(64));
  CompressOptions options;
  for (const std::uint32_t rate : {0u, 33u}) {
    options.rate = rate;
    EXPECT_THAT([&] { compress(reader, options); }, ThrowsMessage<Error>(HasSubstr("1 to 32")));
  }
}

TEST(ZfpFile, FilesOfOtherWriters) {
  for (const glm::uvec3 &dims : kDims) {
    for (const std::uint32_t bits : {9u, 31u, 64u, 100u, 1000u, 2048u}) {
      SCOPED_TRACE(fmt::format("{}x{}x{}, {} bits per block", dims.x, dims.y, dims.z, bits));
      const TemporaryFolder folder;
      std::vector<float> voxels = wavy(dims);
      const std::string bytes = zfp_file(voxels, dims, bits);
      write_file(folder / "a.zfp", bytes);
      const CompressedVolume volume = read_zfp_file(folder / "a.zfp");
      EXPECT_EQ(volume.info.dims, dims);
      EXPECT_EQ(volume.bits_per_block, bits);
      EXPECT_EQ(volume.words.size(), (volume.block_count() * bits + 31) / 32 + 2);
      EXPECT_EQ(volume.value_range[1], std::numeric_limits<float>::infinity());
      EXPECT_FALSE(volume.max_voxel_error);

      const auto run = test::run_command(fmt::format(
          "zfp -q -h -z '{}' -o '{}'", (folder / "a.zfp").string(), (folder / "a.f32").string()));
      ASSERT_EQ(run.status, 0) << run.err;
      const std::vector<float> ours = decode_with_libzfp(volume);
      const std::string theirs = test::read_file(folder / "a.f32");
      ASSERT_EQ(theirs.size(), ours.size() * sizeof(float));
      EXPECT_EQ(std::memcmp(theirs.data(), ours.data(), theirs.size()), 0);
    }
  }
}

TEST(ZfpFile, LongModeHeader) {
  // libzfp writes the long form only for modes that the short one cannot say; other writers may
  // always do.
  const glm::uvec3 dims(9, 6, 5);
  std::vector<float> voxels = wavy(dims);
  const TemporaryFolder folder;
  write_file(folder / "short.zfp", zfp_file(voxels, dims, 320));
  std::vector<std::uint64_t> buffer(1000);
  bitstream *bits = stream_open(buffer.data(), buffer.size() * 8);
  zfp_stream *stream = zfp_stream_open(bits);
  zfp_stream_set_params(stream, 320, 320, ZFP_MAX_PREC, ZFP_MIN_EXP);
  zfp_field *field = zfp_field_3d(voxels.data(), zfp_type_float, dims.x, dims.y, dims.z);
  zfp_write_header(stream, field, ZFP_HEADER_MAGIC | ZFP_HEADER_META);
  stream_write_bits(bits, 0xFFF, 12);
  stream_write_bits(bits, 320 - 1, 15);
  stream_write_bits(bits, 320 - 1, 15);
  stream_write_bits(bits, ZFP_MAX_PREC - 1, 7);
  stream_write_bits(bits, std::uint64_t(ZFP_MIN_EXP + 16495), 15);
  const std::size_t length = zfp_compress(stream, field);
  write_file(folder / "long.zfp",
             std::string_view(reinterpret_cast<const char *>(buffer.data()), length));
  zfp_field_free(field);
  zfp_stream_close(stream);
  stream_close(bits);
  EXPECT_EQ(read_zfp_file(folder / "long.zfp").words, read_zfp_file(folder / "short.zfp").words);
}

TEST(ZfpFile, OtherKindsAreRefusedByName) {
  const TemporaryFolder folder;
  const std::string raw = (folder / "raw").string(), packed = (folder / "a.zfp").string();
  write_file(folder / "raw", std::string(8 * 8 * 8 * 8, 'a'));
  for (const auto &[arguments, text] : {std::pair("-d -3 8 8 8 -r 8", "float64"),
                                        {"-t i32 -3 8 8 8 -r 8", "int32"},
                                        {"-t i64 -3 8 8 8 -r 8", "int64"},
                                        {"-f -1 512 -r 8", "1D"},
                                        {"-f -2 16 32 -r 8", "2D"},
                                        {"-f -4 8 8 4 2 -r 8", "4D"},
                                        {"-f -3 8 8 8 -p 8", "fixed precision"},
                                        {"-f -3 8 8 8 -c 64 512 0 -1074", "expert"},
                                        {"-f -3 8 8 8 -c 512 512 12 -1074", "expert"},
                                        {"-f -3 8 8 8 -r 33", "2112 bits per zfp block"},
                                        {"-f -3 8 1 64 -r 8", "8x1x64"}}) {
    const auto run =
        test::run_command(fmt::format("zfp -q -h {} -i '{}' -z '{}'", arguments, raw, packed));
    ASSERT_EQ(run.status, 0) << arguments << run.err;
    EXPECT_THAT([&] { read_zfp_file(packed); }, ThrowsMessage<Error>(HasSubstr(text))) << arguments;
  }
}

TEST(ZfpFile, FewerBitsThanAnExponentAreRefused) {
  // libzfp itself writes and reads past such blocks (its tool crashes), so only the mode bits are
  // changed here.
  const TemporaryFolder folder;
  std::vector<float> voxels = wavy({8, 8, 8});
  std::string bytes = zfp_file(voxels, {8, 8, 8}, 64);
  constexpr std::size_t kModeAt =
      84 / 8;  // the 12 bits behind magic (32) and dims (52): bits per block - 1
  for (const std::uint32_t bits : {1u, 5u, 8u}) {
    bytes[kModeAt] = char((bytes[kModeAt] & 0xF) | ((bits - 1) & 0xF) << 4);
    bytes[kModeAt + 1] = char((bits - 1) >> 4);
    write_file(folder / "a.zfp", bytes);
    EXPECT_THAT([&] { read_zfp_file(folder / "a.zfp"); },
                ThrowsMessage<Error>(HasSubstr(fmt::format("{} bits per zfp block", bits))));
  }
}

TEST(ZfpFile, AnyFlippedBitIsNoticed) {
  const TemporaryFolder folder;
  ArrayReader reader({7, 6, 5}, wavy({7, 6, 5}));
  CompressOptions options;
  options.rate = 2;
  compress_to_file(reader, options, folder / "a.zfp");
  const std::string right = test::read_file(folder / "a.zfp");
  constexpr std::size_t kHeaderBits = 12 * 8, kFooterBits = 24 * 8;
  for (std::size_t bit = 0; bit < right.size() * 8; ++bit) {
    // Every bit of header and footer, one of each other byte: a test of seconds, not of minutes
    // under sanitizers.
    const bool in_the_middle = bit >= kHeaderBits && bit < right.size() * 8 - kFooterBits;
    if (in_the_middle && bit % 8 != bit / 8 * 5 % 8) continue;
    std::string wrong = right;
    wrong[bit / 8] = char(wrong[bit / 8] ^ (1 << bit % 8));
    write_file(folder / "b.zfp", wrong);
    EXPECT_THROW(read_zfp_file(folder / "b.zfp"), Error) << "bit " << bit;
  }
}

TEST(ZfpFile, AnyCutIsNoticedButTheLossOfTheWholeTrailer) {
  const TemporaryFolder folder;
  ArrayReader reader({7, 6, 5}, wavy({7, 6, 5}));
  CompressOptions options;
  options.rate = 2;
  compress_to_file(reader, options, folder / "a.zfp");
  const std::string right = test::read_file(folder / "a.zfp");
  const std::size_t last_payload_byte = 12 + 8 * 16, plain_zfp = last_payload_byte + 4;
  for (std::size_t length = 0; length < right.size(); ++length) {
    write_file(folder / "b.zfp", right.substr(0, length));
    if (length >= last_payload_byte && length <= plain_zfp) {
      EXPECT_NO_THROW(read_zfp_file(folder / "b.zfp"))
          << "a plain zfp file of " << length << " bytes";
    } else {
      EXPECT_THROW(read_zfp_file(folder / "b.zfp"), Error) << "cut to " << length;
    }
  }
  write_file(folder / "b.zfp", right + "x");
  EXPECT_THROW(read_zfp_file(folder / "b.zfp"), Error);
}

TEST(ZfpFile, NothingIsLeftWhenReadingFails) {
  const TemporaryFolder folder;
  write_file(folder / "in_8x8x8_uint8.raw.gz", std::string_view("\x1f\x8b\x08 and no more"));
  EXPECT_THROW(
      {
        const auto reader = open_volume(folder / "in_8x8x8_uint8.raw.gz");
        compress_to_file(*reader, {}, folder / "a.zfp");
      },
      Error);
  EXPECT_EQ(folder.num_files(), 1u);
  ArrayReader reader({4, 4, 4}, std::vector<float>(64));
  EXPECT_THROW(compress_to_file(reader, {}, folder / "missing" / "a.zfp"), Error);
}

}  // namespace
}  // namespace isowave::core
