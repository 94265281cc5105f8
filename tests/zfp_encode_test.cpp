// kernels_cl/portable/zfp_encode.h, on the host and through core/zfp_encode, against libzfp: the
// same bits. Then whole volumes compressed on a device against the host.

#include "core/stages/zfp_encode.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/error.hpp"
#include "kernels_cl/portable/zfp_encode.h"
#include "tests/array_reader.hpp"
#include "tests/run_program.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"
#include "tests/zfp_values.hpp"

namespace isowave::core {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// What compress() hands to an encoder: tiny values are 0.
std::vector<float> flushed(std::vector<float> voxels) {
  for (float &voxel : voxels) {
    if (std::abs(voxel) < kMinMagnitude) voxel = 0.0f;
  }
  return voxels;
}

/// Our encoder on the host. Words as compress_with_libzfp() gives them.
std::vector<uint> encode_on_host(const std::vector<float> &voxels, const glm::uvec3 &dims,
                                 std::uint32_t bits_per_block) {
  const glm::uvec3 blocks = (dims + 3u) / 4u;
  std::vector<uint> words;
  for (uint b = 0; b < blocks.x * blocks.y * blocks.z; ++b) {
    const glm::uvec3 begin =
        4u * glm::uvec3(b % blocks.x, b / blocks.x % blocks.y, b / blocks.x / blocks.y);
    const glm::uvec3 count = glm::min(dims - begin, 4u);
    std::array<float, 64> values{};
    for (uint v = 0; v < 64; ++v) {
      const uint x = begin.x + padded_coordinate(v % 4, count.x);
      const uint y = begin.y + padded_coordinate(v / 4 % 4, count.y);
      const uint z = begin.z + padded_coordinate(v / 16, count.z);
      values[v] = voxels[(std::size_t{z} * dims.y + y) * dims.x + x];
    }
    words.resize(words.size() + bits_per_block / 32, 0xDEADBEEFu);
    zfp_encode_block(values.data(), bits_per_block,
                     words.data() + words.size() - bits_per_block / 32);
  }
  words.resize(words.size() + 2);
  return words;
}

/// Values whose coefficients are random bits, most of them in few bit planes of one exponent.
std::vector<float> voxels_of_random_bits(const glm::uvec3 &dims, std::uint32_t bits_per_block,
                                         uint seed) {
  Random random(seed);
  CompressedVolume volume;
  volume.info.dims = dims;
  volume.bits_per_block = bits_per_block;
  volume.words.resize(volume.block_count() * bits_per_block / 32 + 2);
  for (std::size_t i = 0; i < volume.words.size() - 2; ++i) {
    // Fewer ones make longer runs.
    volume.words[i] = seed % 2 == 0 ? random() : random() & random() & random();
    if (i % (bits_per_block / 32) == 0)
      volume.words[i] = (volume.words[i] & ~0x1FFu) | 1u | 127u << 1;
  }
  return decode_with_libzfp(volume);
}

void expect_encoded_on_host(const std::vector<float> &voxels, const glm::uvec3 &dims,
                            std::uint32_t bits_per_block) {
  EXPECT_EQ(first_difference(encode_on_host(voxels, dims, bits_per_block),
                             compress_with_libzfp(voxels, dims, bits_per_block).words),
            kNoDifference)
      << bits_per_block << " bits per block";
}

TEST(ZfpEncodeBlock, EveryRateAndKindEqualsLibzfp) {
  const glm::uvec3 dims(21, 6, 9);
  for (const ValueKind kind : kValueKinds) {
    SCOPED_TRACE(fmt::format("values {}", static_cast<int>(kind)));
    const std::vector<float> voxels = flushed(make_voxels(kind, dims, 1));
    for (std::uint32_t bits = 32; bits <= 2048; bits += 32)
      expect_encoded_on_host(voxels, dims, bits);
  }
}

TEST(ZfpEncodeBlock, PartialBlocksOfEverySizeEqualLibzfp) {
  for (uint size = 0; size < 64; ++size) {
    const glm::uvec3 dims = glm::uvec3(2 + size % 4, 2 + size / 4 % 4, 2 + size / 16);
    SCOPED_TRACE(fmt::format("{}x{}x{}", dims.x, dims.y, dims.z));
    const std::vector<float> voxels = random_voxels(dims, -100, 100, size);
    for (const std::uint32_t bits : {64u, 512u, 2048u}) expect_encoded_on_host(voxels, dims, bits);
  }
}

TEST(ZfpEncodeBlock, AnyCoefficientsEqualLibzfp) {
  const glm::uvec3 dims(32, 32, 16);
  for (const std::uint32_t source_bits : {32u, 64u, 256u, 1024u, 2048u}) {
    for (uint seed = 0; seed < 4; ++seed) {
      SCOPED_TRACE(fmt::format("values of {} random bits, seed {}", source_bits, seed));
      const std::vector<float> voxels = voxels_of_random_bits(dims, source_bits, seed);
      for (const std::uint32_t bits :
           {32u, 64u, 96u, 128u, 192u, 320u, 512u, 1024u, 1728u, 2048u}) {
        expect_encoded_on_host(voxels, dims, bits);
      }
    }
  }
}

TEST(ZfpEncodeBlock, OneVoxelAndLimitsEqualLibzfp) {
  const glm::uvec3 dims(4, 4, 4 * 64);
  for (const float value :
       {1.0f, -1.0f, 0x1.fffffep0f, kMinMagnitude, std::nextafter(kMaxMagnitude, 0.0f)}) {
    for (const float others : {0.0f, -0.0f, kMinMagnitude, -value}) {
      SCOPED_TRACE(fmt::format("one voxel of {}, others {}", value, others));
      std::vector<float> voxels(64 * 64, others);
      for (std::size_t block = 0; block < 64; ++block) voxels[65 * block] = value;
      for (std::uint32_t bits = 64; bits <= 2048; bits += 64)
        expect_encoded_on_host(voxels, dims, bits);
    }
  }
}

TEST(ZfpEncodeBlock, IntegersEqualLibzfp) {
  const glm::uvec3 dims(32, 32, 32);
  Random random(5);
  for (const uint largest : {1u, 3u, 255u, 65535u}) {
    std::vector<float> voxels(std::size_t{32} * 32 * 32);
    for (float &voxel : voxels) voxel = static_cast<float>(random() & largest);
    for (std::uint32_t bits = 64; bits <= 2048; bits += 64)
      expect_encoded_on_host(voxels, dims, bits);
  }
}

class ZfpEncodeOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  static constexpr uint kSentinel = 0xDEADBEEFu;

  /// Words and errors of a call; what lies behind the words stays.
  void expect_encoded(const std::vector<float> &voxels, const glm::uvec3 &dims,
                      std::uint32_t bits_per_block) {
    SCOPED_TRACE(
        fmt::format("{}x{}x{}, {} bits per block", dims.x, dims.y, dims.z, bits_per_block));
    const CompressedVolume expected = compress_with_libzfp(voxels, dims, bits_per_block);
    const std::size_t num_words = expected.words.size() - 2, num_blocks = expected.block_count();
    const ocl::Buffer<float> d_voxels(device_, "voxels", std::span<const float>(voxels));
    ocl::Buffer<uint> words(device_, "words", num_words + 2);
    words.fill(kSentinel);
    encode_(d_voxels, dims, bits_per_block, words);
    std::vector<uint> got = words.read();
    EXPECT_EQ(got[num_words], kSentinel);
    EXPECT_EQ(got[num_words + 1], kSentinel);
    got[num_words] = got[num_words + 1] = 0;
    ASSERT_EQ(first_difference(got, expected.words), kNoDifference);

    ocl::Buffer<float> errors(device_, "errors", ZfpEncode::kErrorsPerBlock * num_blocks + 1);
    errors.fill(-1.0f);
    encode_.measure_errors(d_voxels, dims, bits_per_block, words, errors);
    const std::vector<float> pairs = errors.read(), decoded = decode_with_libzfp(expected);
    const glm::uvec3 blocks = expected.num_blocks();
    std::vector<double> got_errors(ISO_BOUND_PLACES * num_blocks),
        expected_errors(got_errors.size());
    for (std::size_t i = 0; i < got_errors.size(); ++i)
      got_errors[i] = double{pairs[2 * i]} + double{pairs[2 * i + 1]};
    for (std::size_t i = 0; i < voxels.size(); ++i) {
      const std::size_t x = i % dims.x, y = i / dims.x % dims.y, z = i / dims.x / dims.y;
      const uint place = bound_place(static_cast<uint>(x % 4 + 4 * (y % 4) + 16 * (z % 4)));
      double &largest =
          expected_errors[ISO_BOUND_PLACES * (x / 4 + blocks.x * (y / 4 + blocks.y * (z / 4))) +
                          place];
      largest = std::max(largest, std::abs(double{decoded[i]} - double{voxels[i]}));
    }
    EXPECT_EQ(first_difference(got_errors, expected_errors), kNoDifference);
    EXPECT_EQ(pairs.back(), -1.0f);
  }

  ocl::Device device_{GetParam()};
  ZfpEncode encode_{device_};
};

TEST_P(ZfpEncodeOnDevice, SmallPartialBlocks) {
  const glm::uvec3 dims(5, 6, 7);
  for (const std::uint32_t bits : {32u, 64u, 512u})
    expect_encoded(random_voxels(dims, -3, 3, 10), dims, bits);
}

TEST_P(ZfpEncodeOnDevice, EveryRate) {
  const glm::uvec3 dims(13, 14, 15);
  const std::vector<float> voxels = flushed(make_voxels(ValueKind::kMixed, dims, 11));
  for (std::uint32_t bits = 32; bits <= 2048; bits += 32) expect_encoded(voxels, dims, bits);
}

TEST_P(ZfpEncodeOnDevice, EveryKindOfValues) {
  for (const glm::uvec3 dims :
       {glm::uvec3(5, 6, 7), glm::uvec3(2, 2, 2), glm::uvec3(4, 4, 4), glm::uvec3(41, 41, 41)}) {
    for (const ValueKind kind : kValueKinds) {
      SCOPED_TRACE(fmt::format("values {}", static_cast<int>(kind)));
      const std::vector<float> voxels = flushed(make_voxels(kind, dims, 12));
      for (const std::uint32_t bits : {64u, 256u, 2048u}) expect_encoded(voxels, dims, bits);
    }
  }
}

TEST_P(ZfpEncodeOnDevice, AnyCoefficients) {
  const glm::uvec3 dims(32, 32, 16);
  for (uint seed = 0; seed < 4; ++seed) {
    const std::vector<float> voxels = voxels_of_random_bits(dims, 64 << 2 * (seed / 2), seed);
    for (const std::uint32_t bits : {64u, 192u, 1024u}) expect_encoded(voxels, dims, bits);
  }
}

TEST_P(ZfpEncodeOnDevice, MisuseIsRefused) {
  const ocl::Buffer<float> voxels(device_, "voxels", 64);
  ocl::Buffer<uint> words(device_, "words", 4);
  ocl::Buffer<float> errors(device_, "errors", 1);
  for (const std::uint32_t bits : {0u, 48u, 160u, 2080u}) {
    EXPECT_THROW(encode_(voxels, {4, 4, 4}, bits, words), std::invalid_argument) << bits;
  }
  EXPECT_THROW(encode_(voxels, {5, 4, 4}, 32, words), std::invalid_argument);
  EXPECT_THROW(encode_.measure_errors(voxels, {4, 4, 4}, 128, words, errors),
               std::invalid_argument);
  EXPECT_THROW(encode_.measure_errors(voxels, {4, 4, 4}, 96, words, errors), std::invalid_argument);
}

/// compress() and compress_to_file() with CompressOptions::device against the same without.
class CompressOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  void expect_same_as_host(const glm::uvec3 &dims, const std::vector<float> &voxels,
                           CompressOptions options) {
    SCOPED_TRACE(fmt::format("{}x{}x{} at rate {}", dims.x, dims.y, dims.z, options.rate));
    ArrayReader reader(dims, voxels);
    const test::TemporaryFolder folder;
    const CompressedVolume host = compress(reader, options);
    compress_to_file(reader, options, folder / "host.zfp");
    options.encoder = encoder_on(device_);
    const CompressedVolume device = compress(reader, options);
    compress_to_file(reader, options, folder / "device.zfp");
    EXPECT_EQ(device.bits_per_block, host.bits_per_block);
    EXPECT_EQ(first_difference(device.words, host.words), kNoDifference);
    EXPECT_EQ(device.value_range, host.value_range);
    EXPECT_EQ(device.max_voxel_error, host.max_voxel_error);
    EXPECT_EQ(device.bounds.codes, host.bounds.codes);
    EXPECT_TRUE(test::read_file(folder / "device.zfp") == test::read_file(folder / "host.zfp"));
    EXPECT_EQ(device_.ledger().current(), 0u);
  }

  ocl::Device device_{GetParam()};
};

TEST_P(CompressOnDevice, SmallVolumeAsOnTheHost) {
  const glm::uvec3 dims(9, 6, 5);
  CompressOptions options;
  options.rate = 3;
  options.measure_error = true;
  expect_same_as_host(dims, random_voxels(dims, -1, 1, 20), options);
}

TEST_P(CompressOnDevice, EveryKindAsOnTheHost) {
  for (const ValueKind kind : kValueKinds) {
    SCOPED_TRACE(fmt::format("values {}", static_cast<int>(kind)));
    const glm::uvec3 dims(33, 18, 22);
    CompressOptions options;
    for (const std::uint32_t rate : {1u, 7u, 32u}) {
      options.rate = rate;
      options.measure_error = rate != 7;
      expect_same_as_host(dims, make_voxels(kind, dims, 21), options);
    }
  }
}

TEST_P(CompressOnDevice, LevelsAndBoundsAsOnTheHost) {
  const glm::uvec3 dims(40, 33, 27);
  for (const std::uint32_t rate : {4u, 12u})
    expect_same_as_host(dims, random_voxels(dims, -1, 1, 23),
                        {.rate = rate, .measure_error = true, .levels = 0});
}

/// Several pieces of whole slabs, and slabs that are cut into rows of blocks.
TEST_P(CompressOnDevice, ManyPiecesAsOnTheHost) {
  CompressOptions options;
  options.rate = 2;
  for (const glm::uvec3 dims : {glm::uvec3(600, 600, 13), glm::uvec3(1103, 1001, 6)}) {
    ASSERT_GT(std::uint64_t{dims.x} * dims.y * dims.z, LayerEncoder::kPieceVoxels);
    options.measure_error = dims.x == 1103;
    expect_same_as_host(dims, make_voxels(ValueKind::kSmooth, dims, 22), options);
    EXPECT_LT(device_.ledger().peak(), 64u << 20);
  }
}

TEST_P(CompressOnDevice, RefusesAndMapsAsTheHost) {
  const glm::uvec3 dims(600, 600, 13);  // the last bad voxel is in another piece than the first
  std::vector<float> voxels(std::size_t{600} * 600 * 13, 1.0f);
  voxels[(2 * 600 + 5) * 600 + 7] = std::numeric_limits<float>::infinity();
  voxels.back() = -std::numeric_limits<float>::infinity();
  voxels[9] = -0.0f;
  voxels[10] = 1e-40f;
  CompressOptions options{.rate = 8};
  options.encoder = encoder_on(device_);
  const test::TemporaryFolder folder;
  ArrayReader reader(dims, voxels);
  EXPECT_THAT(
      [&] { compress_to_file(reader, options, folder / "a.zfp"); },
      ThrowsMessage<Error>(AllOf(HasSubstr("2 of 4680000 voxels"), HasSubstr("x=7, y=5, z=2"))));
  EXPECT_EQ(folder.num_files(), 0u);
  options.input.map_nan = -2.0f;
  expect_same_as_host(dims, voxels, options);

  voxels.back() = kMaxMagnitude;
  ArrayReader too_large(dims, voxels);
  EXPECT_THAT([&] { compress(too_large, options); },
              ThrowsMessage<Error>(
                  AllOf(HasSubstr("1 of 4680000 voxels"), HasSubstr("x=599, y=599, z=12"))));
  options.rate = 33;
  EXPECT_THROW(compress(reader, options), Error);
  EXPECT_EQ(device_.ledger().current(), 0u);
}

/// A reader that fails while a piece is under way, and an output that cannot be written.
TEST_P(CompressOnDevice, FailuresOnTheWayAreReported) {
  class FailingReader : public ArrayReader {
   public:
    using ArrayReader::ArrayReader;
    void read_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                     std::span<float> out) override {
      if (z_begin > 0) throw Error("no more layers");
      ArrayReader::read_layers(z_begin, num_layers, out);
    }
  };
  const glm::uvec3 dims(1100, 1000, 8);
  const std::vector<float> voxels(std::size_t{1100} * 1000 * 8, 1.0f);
  CompressOptions options{.rate = 8};
  options.encoder = encoder_on(device_);
  FailingReader failing(dims, voxels);
  EXPECT_THAT([&] { compress(failing, options); }, ThrowsMessage<Error>("no more layers"));
  ArrayReader reader(dims, voxels);
  EXPECT_THROW(compress_to_file(reader, options, "/nowhere/a.zfp"), Error);
  EXPECT_EQ(device_.ledger().current(), 0u);
}

INSTANTIATE_TEST_SUITE_P(Devices, ZfpEncodeOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);
INSTANTIATE_TEST_SUITE_P(Devices, CompressOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
