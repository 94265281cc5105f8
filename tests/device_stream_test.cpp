// The compressed volume in one buffer, in several, and on the host behind a window: decoders see
// the same bits.

#include "core/stream/device_stream.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <numeric>

#include "core/base/error.hpp"
#include "core/io/input_file.hpp"
#include "core/stages/macrocells.hpp"
#include "core/stages/zfp_decode.hpp"
#include "kernels_cl/portable/zfp_codec.h"
#include "tests/frame_scene.hpp"
#include "tests/run_program.hpp"
#include "tests/slot_values.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::uint32_t kOddBits[] = {9, 37, 64, 100, 777, 2048};
constexpr std::int32_t kOddExponents[] = {
    ISO_REVERSIBLE, -20, -3, 1};  ///< of volumes whose blocks have lengths of their own

/// 6^3 blocks, partial ones too: 2, 3 and 4 parts can be had even where only 32 blocks are whole
/// words.
constexpr glm::uvec3 kDims(23, 22, 21);

CompressedVolume volume_of(std::uint32_t bits_per_block, const glm::uvec3 &dims = kDims) {
  return compress_with_libzfp(random_voxels(dims, -3, 3, bits_per_block), dims, bits_per_block);
}

CompressedVolume indexed_volume(std::int32_t min_exponent, const glm::uvec3 &dims = kDims) {
  return compress_with_libzfp(random_voxels(dims, -3, 3, 7), dims, 0, min_exponent);
}

/// Volumes of every kind.
std::vector<std::pair<std::string, CompressedVolume>> odd_volumes() {
  std::vector<std::pair<std::string, CompressedVolume>> volumes;
  for (const std::uint32_t bits : kOddBits)
    volumes.emplace_back(fmt::format("{} bits per block", bits), volume_of(bits));
  for (const std::int32_t exponent : kOddExponents) {
    volumes.emplace_back(fmt::format("planes to 2^{}", exponent), indexed_volume(exponent));
  }
  return volumes;
}

/// 3^3 blocks of 100 bits; 8 are whole words.
CompressedVolume small_volume() {
  return volume_of(100, {9, 10, 11});
}

/// The largest limit at which a volume needs so many parts; 0: there is none.
std::uint64_t limit_for(const CompressedVolume &volume, std::uint32_t num_parts) {
  for (std::uint64_t bytes = volume.word_count() * sizeof(uint); bytes > 0; --bytes) {
    if (split_stream(volume, bytes).num_parts == num_parts) return bytes;
  }
  return 0;
}

// ---- cutting

TEST(StreamSplit, PartsHoldTheirBlocksAndKeepTheLimit) {
  for (const auto &[name, volume] : odd_volumes()) {
    const std::uint64_t all = volume.word_count() * sizeof(uint);
    std::uint32_t last_parts = 1;
    for (std::uint64_t limit = all; limit > 0; --limit) {
      SCOPED_TRACE(fmt::format("{}, {} of {} bytes", name, limit, all));
      const StreamSplit split = split_stream(volume, limit);
      if (split.num_parts == 0) {
        EXPECT_EQ(last_parts, kMaxStreamParts) << "given up too early";
        break;
      }
      ASSERT_EQ(split.words.size(), split.num_parts);
      ASSERT_GE(split.num_parts, last_parts);
      last_parts = split.num_parts;
      for (const std::uint64_t words : split.words) EXPECT_LE(words * sizeof(uint), limit);
      if (split.num_parts == 1) continue;
      for (std::uint32_t b = 0; b < volume.block_count(); ++b) {
        const std::uint64_t part = volume.block_begin(b) / 32 / split.words_per_part;
        ASSERT_LT(part, split.num_parts);
        const std::uint64_t end =
            volume.block_begin(b) + volume.block_bits(b) - part * split.words_per_part * 32;
        ASSERT_LE((end + 31) / 32 + 2, split.words[part])
            << "block " << b << ", and what decoders read past it";
      }
    }
    EXPECT_EQ(last_parts, kMaxStreamParts);
  }
}

TEST(StreamSplit, NoLimitAndNoRoom) {
  const CompressedVolume volume = volume_of(512);
  EXPECT_EQ(split_stream(volume, ~std::uint64_t(0)).num_parts, 1u);
  for (const std::uint64_t limit : {0u, 3u, 4u, 8u, 12u})
    EXPECT_EQ(split_stream(volume, limit).num_parts, 0u);
}

// ---- reading bits, from words and from a file

/// Bits [bit, bit + 32) of words, one by one.
uint word_at(const std::vector<uint> &words, std::uint64_t bit, std::uint64_t end) {
  uint word = 0;
  for (std::uint64_t i = bit; i < std::min(bit + 32, end); ++i) {
    word |= (words[i / 32] >> (i % 32) & 1u) << (i - bit);
  }
  return word;
}

TEST(ReadWords, AnyBitOfWordsAndFiles) {
  const test::TemporaryFolder folder;
  for (const std::uint32_t bits : kOddBits) {
    SCOPED_TRACE(bits);
    const CompressedVolume volume = volume_of(bits);
    const std::uint64_t end = volume.block_count() * bits;
    // The file of another writer: its payload begins at any bit.
    CompressedVolume shifted = volume;
    shifted.words.clear();
    for (const std::uint32_t first_bit : {0u, 1u, 31u, 37u, 96u}) {
      std::string bytes((first_bit + end + 7) / 8, '\xff');  // not part of the payload: ones
      for (std::uint64_t i = 0; i < end; ++i) {
        const std::uint64_t to = first_bit + i;
        if ((volume.words[i / 32] >> (i % 32) & 1u) == 0) bytes[to / 8] &= char(~(1u << to % 8));
      }
      test::write_file(folder / "bits", bytes);
      shifted.file = std::make_shared<InputFile>(folder / "bits");
      shifted.file_first_bit = first_bit;
      for (const CompressedVolume *source :
           {&volume, static_cast<const CompressedVolume *>(&shifted)}) {
        EXPECT_EQ(source->word_count(), volume.words.size());
        for (const std::uint64_t bit : {std::uint64_t{0}, std::uint64_t{bits},
                                        std::uint64_t{13} * bits, end - bits, end - 1, end}) {
          std::vector<uint> got(7, 0xDEADBEEFu), expected(7);
          for (std::size_t i = 0; i < got.size(); ++i) {
            expected[i] = bit + 32 * i < end ? word_at(volume.words, bit + 32 * i, end) : 0;
          }
          source->read_words(bit, got);
          ASSERT_EQ(got, expected)
              << "bit " << bit << " of " << end << ", file from bit " << first_bit;
        }
      }
    }
  }
}

// ---- on devices

/// The index of a volume whose blocks have other lengths, by as much as `most`, which add up to the
/// same.
std::vector<std::uint32_t> lying_index(const CompressedVolume &volume, std::uint32_t most,
                                       uint seed) {
  std::vector<std::uint32_t> lengths;
  for (uint b = 0; b < volume.block_count(); ++b) lengths.push_back(volume.block_bits(b));
  Random random(seed);
  for (std::uint32_t &from : lengths) {
    std::uint32_t &to = lengths[random() % lengths.size()];
    const std::uint32_t moved =
        std::min({std::uint32_t(random() % (most + 1)), from - 1, ISO_MAX_BLOCK_BITS - to});
    from -= moved;
    to += moved;
  }
  BlockIndexBuilder index;
  for (const std::uint32_t length : lengths) index.add(length);
  return index.finish();
}

class DeviceStreamOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  /// Decodes all blocks in a shuffled order through the stream.
  std::vector<float> decode(const CompressedVolume &volume, const DeviceStream &stream) {
    const auto num_blocks = static_cast<uint>(volume.block_count());
    std::vector<uint> block_ids(num_blocks);
    std::iota(block_ids.begin(), block_ids.end(), 0u);
    Random random(5);
    std::ranges::shuffle(block_ids, random);
    // Twice as long a list as is granted: the rest must not be looked at.
    std::vector<uint> listed = block_ids;
    listed.resize(2 * std::size_t{num_blocks}, 0u);
    PassCounts start{};
    start.decoded_count = num_blocks;
    const CountsBuffer counts(device_, "counts", std::span<const PassCounts>(&start, 1));
    const ocl::Buffer<uint> d_block_ids(device_, "block ids", std::span<const uint>(listed)),
        d_slots(device_, "slots", std::span<const uint>(listed));
    const FrameParams frame{};
    ocl::Buffer<ulong> inside(device_, "inside", num_blocks);
    ocl::Buffer<SlotValue> values(device_, "values", 256 * std::size_t{num_blocks});
    ZfpDecode zfp_decode(device_, num_blocks, stream.defines());
    zfp_decode(stream, frame, counts, d_block_ids, d_slots, values, inside);
    return test::slot_values(values);
  }

  void expect_decoded(const CompressedVolume &volume, const DeviceStream &stream) {
    const std::vector<float> got = decode(volume, stream),
                             expected = decode_blocks_with_libzfp(volume);
    ASSERT_EQ(got.size(), expected.size());
    EXPECT_EQ(std::memcmp(got.data(), expected.data(), got.size() * sizeof(float)), 0);
  }

  /// The ranges do not depend on where the stream is.
  void expect_same_ranges(const CompressedVolume &volume, const DeviceStream &stream) {
    const FrameParams params = grid_frame(volume.info.dims);
    const Macrocells got(device_, params, stream);
    const DeviceStream whole(device_, volume);
    const Macrocells expected(device_, params, whole);
    EXPECT_EQ(first_difference(got.ranges().read(), expected.ranges().read()), kNoDifference);
    EXPECT_EQ(got.thresholds(), expected.thresholds());
  }

  /// A block ends where its length says, however it lies: the same wrong values everywhere, and
  /// nothing outside the stream is read.
  void check_lying_index(const CompressedVolume &truth) {
    const auto num_blocks = static_cast<uint>(truth.block_count());
    std::vector<CompressedVolume> volumes;
    for (const std::uint32_t most : {1u, 40u, ISO_MAX_BLOCK_BITS}) {
      volumes.push_back(truth);
      volumes.back().index = lying_index(truth, most, most);
    }
    BlockIndexBuilder short_blocks;  // all but the last are too short for an exponent
    for (uint b = 0; b + 1 < num_blocks; ++b) short_blocks.add(1 + b % 9);
    const std::uint64_t rest = std::min<std::uint64_t>(
        truth.payload_bits() - 5 * std::uint64_t{num_blocks}, ISO_MAX_BLOCK_BITS);
    short_blocks.add(static_cast<uint>(rest));
    volumes.push_back(truth);
    volumes.back().index = short_blocks.finish();
    for (const CompressedVolume &volume : volumes) {
      const std::vector<float> expected = decode_blocks_with_libzfp(volume);
      EXPECT_NE(first_difference(expected, decode_blocks_with_libzfp(truth)), kNoDifference);
      expect_decoded(volume, DeviceStream(device_, volume));
      expect_decoded(volume, DeviceStream(device_, volume, limit_for(volume, 2)));
      expect_decoded(volume, DeviceStream(device_, volume, OnHost{8}));
      expect_same_ranges(volume, DeviceStream(device_, volume, OnHost{5}));
      for (uint b = 0; b < num_blocks; ++b) {
        float values[64];
        zfp_decode_any_block(volume.words.data(), volume.block_begin(b), volume.block_bits(b),
                             volume.precision.min_exponent, values);
        ASSERT_EQ(std::memcmp(values, &expected[64 * std::size_t{b}], sizeof(values)), 0)
            << "block " << b;
      }
    }
  }

  ocl::Device device_{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Devices, DeviceStreamOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

TEST_P(DeviceStreamOnDevice, SmallPartsDecodeToTheSameBits) {
  for (const CompressedVolume &volume : {small_volume(), indexed_volume(-2, {9, 10, 11}),
                                         indexed_volume(ISO_REVERSIBLE, {9, 10, 11})}) {
    for (const std::uint32_t parts : {2u, 4u}) {
      SCOPED_TRACE(fmt::format("{} bits per block, {} parts", volume.bits_per_block, parts));
      const DeviceStream stream(device_, volume, limit_for(volume, parts));
      ASSERT_EQ(stream.parts.size(), parts);
      expect_decoded(volume, stream);
    }
  }
}

TEST_P(DeviceStreamOnDevice, SmallWholeNumbersAreRounded) {
  CompressedVolume volume = indexed_volume(-1, {9, 10, 11});
  volume.precision.whole_numbers = true;
  expect_decoded(volume, DeviceStream(device_, volume));
  expect_decoded(volume, DeviceStream(device_, volume, OnHost{8}));
}

TEST_P(DeviceStreamOnDevice, SmallLyingIndexDecodesToTheSameBits) {
  check_lying_index(indexed_volume(-4, {9, 10, 11}));
}
TEST_P(DeviceStreamOnDevice, SmallLyingIndexOfAReversibleStreamDecodesToTheSameBits) {
  check_lying_index(indexed_volume(ISO_REVERSIBLE, {9, 10, 11}));
}

/// Where the payload is too large to be copied, blocks are read from the file, wherever it is cut
/// meanwhile.
TEST_P(DeviceStreamOnDevice, SmallFilesThatBecomeShorterAreOneLine) {
  const test::TemporaryFolder folder;
  const auto path = folder / "a.zfp";
  for (const bool indexed : {false, true}) {
    ArrayReader source(test::grid_info({9, 10, 11}), random_voxels({9, 10, 11}, -3, 3, 7));
    CompressOptions options{.rate = 5};
    if (indexed) options.precision = BlockPrecision{-4};
    compress_to_file(source, options, path);
    const std::string bytes = test::read_file(path);
    for (const bool copied : {true, false}) {
      const CompressedVolume volume = open_zfp_file(path);
      const std::uint64_t end = 12 + (volume.payload_bits() + 7) / 8;
      const DeviceStream stream(device_, volume, OnHost{8, copied ? bytes.size() : 0});
      const std::vector<float> expected = decode_blocks_with_libzfp(volume);
      EXPECT_EQ(first_difference(decode(volume, stream), expected), kNoDifference);
      for (const std::uint64_t cut : {end - 1, end / 2, std::uint64_t{13}, std::uint64_t{0}}) {
        std::filesystem::resize_file(path, cut);
        if (copied) {
          EXPECT_EQ(first_difference(decode(volume, stream), expected), kNoDifference);
        } else {
          EXPECT_THAT([&] { decode(volume, stream); },
                      ThrowsMessage<Error>(HasSubstr("truncated while it was in use")));
        }
        EXPECT_THAT([&] { DeviceStream(device_, volume); },
                    ThrowsMessage<Error>(HasSubstr("truncated")));
        EXPECT_THAT([&] { DeviceStream(device_, volume, OnHost{8}); },
                    ThrowsMessage<Error>(HasSubstr("truncated")));
      }
      test::write_file(path, bytes);
    }
  }
}

TEST_P(DeviceStreamOnDevice, PartsOfEveryRate) {
  for (const auto &[name, volume] : odd_volumes()) {
    for (const std::uint32_t parts : {1u, 2u, 3u, 4u}) {
      SCOPED_TRACE(fmt::format("{}, {} parts", name, parts));
      const std::uint64_t limit = limit_for(volume, parts);
      ASSERT_NE(limit, 0u);
      const DeviceStream stream(device_, volume, limit);
      ASSERT_EQ(stream.parts.size(), parts);
      EXPECT_FALSE(stream.window);
      expect_decoded(volume, stream);
      expect_same_ranges(volume, stream);
    }
  }
}

TEST_P(DeviceStreamOnDevice, MoreThanFourPartsAreRefused) {
  const CompressedVolume volume = volume_of(64);
  EXPECT_THAT([&] { DeviceStream(device_, volume, limit_for(volume, 4) / 2); },
              ThrowsMessage<Error>(HasSubstr("does not fit 4 buffers")));
}

TEST_P(DeviceStreamOnDevice, SmallWindowsDecodeToTheSameBits) {
  for (const CompressedVolume &volume : {small_volume(), indexed_volume(-2, {9, 10, 11}),
                                         indexed_volume(ISO_REVERSIBLE, {9, 10, 11})}) {
    for (const std::uint32_t window : {8u, 1000u}) {
      SCOPED_TRACE(fmt::format("{} bits per block, window of {}", volume.bits_per_block, window));
      const DeviceStream stream(device_, volume, OnHost{window});
      expect_decoded(volume, stream);
      EXPECT_EQ(stream.window->uploaded_blocks(), volume.block_count());
    }
  }
}

TEST_P(DeviceStreamOnDevice, WindowsOfEveryRate) {
  for (const auto &[name, volume] : odd_volumes()) {
    for (const std::uint32_t window : {1u, 8u, 107u, 108u, 216u, 217u}) {
      SCOPED_TRACE(fmt::format("{}, window of {}", name, window));
      const DeviceStream stream(device_, volume, OnHost{window});
      EXPECT_TRUE(stream.parts.empty());
      expect_decoded(volume, stream);
      expect_same_ranges(volume, stream);
    }
  }
}

/// A list longer than what is read together with its length, and gathered by several threads.
TEST_P(DeviceStreamOnDevice, LongRequestLists) {
  constexpr glm::uvec3 dims(97, 101, 103);
  const CompressedVolume volume = compress_with_libzfp(random_voxels(dims, -1, 1, 6), dims, 128);
  ASSERT_GT(volume.block_count(), 3u * 4096);
  for (const std::uint32_t window : {1500u, 10'000u, 100'000u}) {
    SCOPED_TRACE(window);
    expect_decoded(volume, DeviceStream(device_, volume, OnHost{window}));
  }
}

TEST_P(DeviceStreamOnDevice, SmallNothingGrantedUploadsNothing) {
  const CompressedVolume volume = volume_of(64);
  const DeviceStream stream(device_, volume, OnHost{8});
  const CountsBuffer counts(device_, "counts", 1);
  const ocl::Buffer<uint> ids(device_, "block ids", 3);
  EXPECT_TRUE(stream.window->read_granted(counts, ids).empty());
  stream.window->bring({}, [](const ocl::Buffer<uint> &, std::uint32_t, std::uint32_t) { FAIL(); });
  EXPECT_EQ(stream.window->uploaded_blocks(), 0u);
}

TEST_P(DeviceStreamOnDevice, DecodersOfAnotherKindOfStreamAreRefused) {
  const CompressedVolume volume = volume_of(64);
  ZfpDecode decode(device_, 8);
  const DeviceStream stream(device_, volume, OnHost{8});
  const CountsBuffer counts(device_, "counts", 1);
  const ocl::Buffer<uint> ids(device_, "block ids", 1);
  const FrameParams frame{};
  ocl::Buffer<SlotValue> values(device_, "values", 256);
  ocl::Buffer<ulong> inside(device_, "inside", 1);
  EXPECT_THROW(decode(stream, frame, counts, ids, ids, values, inside), std::invalid_argument);
}

/// All that a stream takes is booked, and given back.
TEST_P(DeviceStreamOnDevice, SmallMemoryIsBooked) {
  const CompressedVolume volume = volume_of(64);
  {
    const DeviceStream stream(device_, volume, OnHost{16});
    EXPECT_EQ(device_.ledger().current(), 4 * (16 * 2 + 2) * sizeof(uint));
  }
  {
    const DeviceStream stream(device_, volume, limit_for(volume, 3));
    EXPECT_EQ(device_.ledger().current(), (volume.word_count() + 2 * (2 + 2)) * sizeof(uint))
        << "behind two of three parts, a block's 64 bits from the last bit on, and two words that "
           "decoders read";
  }
  EXPECT_EQ(device_.ledger().current(), 0u);
}

}  // namespace
}  // namespace isowave::core
