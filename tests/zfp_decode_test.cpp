// kernels_cl/portable/zfp_codec.h, on the host and through core/zfp_decode, against libzfp: the
// same bits.

#include "core/stages/zfp_decode.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>
#include <random>
#include <vector>

#include "kernels_cl/portable/zfp_codec.h"
#include "tests/slot_values.hpp"
#include "tests/stage_support.hpp"
#include "tests/test_devices.hpp"
#include "tests/zfp_values.hpp"

namespace isowave::core {
namespace {

/// Our decoder on the host: all blocks.
std::vector<float> decode_on_host(const CompressedVolume &volume) {
  std::vector<float> values(volume.block_count() * 64);
  for (std::uint32_t b = 0; b < volume.block_count(); ++b) {
    zfp_decode_any_block(volume.words.data(), volume.block_begin(b), volume.block_bits(b),
                         volume.precision.min_exponent, values.data() + 64 * std::size_t{b});
  }
  return values;
}

/// Index of the first value of other bits (0.0 and -0.0 differ), or kNoDifference.
std::ptrdiff_t first_other_bits(const std::vector<float> &got, const std::vector<float> &expected) {
  if (got.size() == expected.size() &&
      std::memcmp(got.data(), expected.data(), got.size() * sizeof(float)) == 0)
    return kNoDifference;
  std::size_t i = 0;
  while (i < got.size() && i < expected.size() &&
         std::memcmp(&got[i], &expected[i], sizeof(float)) == 0)
    ++i;
  return static_cast<std::ptrdiff_t>(i);
}

std::vector<std::uint32_t> awkward_bits_per_block() {
  std::vector<std::uint32_t> bits;
  for (std::uint32_t rate = 1; rate <= 32; ++rate) bits.push_back(64 * rate);
  for (const std::uint32_t odd : {9u, 10u, 11u, 31u, 33u, 37u, 63u, 65u, 100u, 777u, 1999u, 2047u})
    bits.push_back(odd);
  return bits;
}

TEST(ZfpCodec, EveryRateAndKindEqualsLibzfp) {
  const glm::uvec3 dims(21, 6, 9);
  for (const std::uint32_t bits_per_block : awkward_bits_per_block()) {
    for (const ValueKind kind : kValueKinds) {
      SCOPED_TRACE(
          fmt::format("{} bits per block, values {}", bits_per_block, static_cast<int>(kind)));
      const CompressedVolume volume =
          compress_with_libzfp(make_voxels(kind, dims, 1), dims, bits_per_block);
      EXPECT_EQ(first_other_bits(decode_on_host(volume), decode_blocks_with_libzfp(volume)),
                kNoDifference);
    }
  }
}

TEST(ZfpCodec, DenormalsEqualLibzfp) {
  const glm::uvec3 dims(8, 8, 8);
  for (const float scale : {1e-30f, 1e-35f, 1e-38f, 1e-41f, 1e-45f}) {
    std::vector<float> voxels = random_voxels(dims, -1.0f, 1.0f, 2);
    for (float &v : voxels) v *= scale;
    const CompressedVolume volume = compress_with_libzfp(voxels, dims, 1024);
    EXPECT_EQ(first_other_bits(decode_on_host(volume), decode_blocks_with_libzfp(volume)),
              kNoDifference)
        << scale;
  }
}

/// Any bits are a stream that libzfp decodes to something; so must we.
TEST(ZfpCodec, RandomBitsEqualLibzfp) {
  Random random(3);
  for (const std::uint32_t bits_per_block : {9u, 37u, 64u, 100u, 512u, 2048u}) {
    CompressedVolume volume;
    volume.info.dims = glm::uvec3(64, 16, 16);
    volume.bits_per_block = bits_per_block;
    volume.words.resize((volume.block_count() * bits_per_block + 31) / 32 + 2);
    std::generate(volume.words.begin(), volume.words.end() - 2, std::ref(random));
    EXPECT_EQ(first_other_bits(decode_on_host(volume), decode_blocks_with_libzfp(volume)),
              kNoDifference)
        << bits_per_block << " bits per block, seed 3";
  }
}

/// What the padding holds is zfp's business; what belongs to the volume is what a zfp reader sees.
TEST(ZfpCodec, PartialBlocksEqualTheVolume) {
  for (const glm::uvec3 dims :
       {glm::uvec3(5, 6, 7), glm::uvec3(2, 2, 2), glm::uvec3(4, 4, 4), glm::uvec3(41, 41, 41)}) {
    for (const std::uint32_t bits_per_block : {37u, 64u, 512u}) {
      const CompressedVolume volume =
          compress_with_libzfp(random_voxels(dims, -100, 100, 4), dims, bits_per_block);
      const std::vector<float> voxels = decode_with_libzfp(volume), values = decode_on_host(volume);
      const glm::uvec3 blocks = volume.num_blocks();
      std::vector<float> gathered(voxels.size());
      for (std::size_t i = 0; i < voxels.size(); ++i) {
        const std::size_t x = i % dims.x, y = i / dims.x % dims.y, z = i / dims.x / dims.y;
        gathered[i] = values[64 * (x / 4 + blocks.x * (y / 4 + blocks.y * (z / 4))) + x % 4 +
                             4 * (y % 4) + 16 * (z % 4)];
      }
      EXPECT_EQ(first_other_bits(gathered, voxels), kNoDifference)
          << dims.x << " x " << dims.y << " x " << dims.z << ", " << bits_per_block
          << " bits per block";
    }
  }
}

class ZfpDecodeOnDevice : public testing::TestWithParam<ocl::DeviceInfo> {
 protected:
  static constexpr float kSentinel = -12345.0f;

  /// Decodes a random part of a shuffled list of blocks to random slots; all other slots keep their
  /// values.
  void expect_decoded(const CompressedVolume &volume, uint seed, SlotType type = SlotType::kFloat32,
                      float sentinel = kSentinel) {
    SCOPED_TRACE(fmt::format("{} bits per block, {} blocks, seed {}", volume.bits_per_block,
                             volume.block_count(), seed));
    Random random(seed);
    const uint num_blocks = static_cast<uint>(volume.block_count());
    const uint num_slots = num_blocks + 5;
    std::vector<uint> block_ids(num_blocks), slots(num_slots);
    std::iota(block_ids.begin(), block_ids.end(), 0u);
    std::iota(slots.begin(), slots.end(), 0u);
    std::ranges::shuffle(block_ids, random);
    std::ranges::shuffle(slots, random);
    PassCounts start = distinct_counts();
    start.decoded_count = num_blocks - num_blocks / 4;
    CountsBuffer counts(device_, "counts", std::span<const PassCounts>(&start, 1));
    ocl::Buffer<SlotValue> values(device_, "values", slot_bytes(type) * num_slots);
    test::fill_slots(values, type, sentinel);
    const DeviceStream stream(device_, volume);
    const ocl::Buffer<uint> d_block_ids(device_, "block ids", std::span<const uint>(block_ids)),
        d_slots(device_, "slots", std::span<const uint>(slots));

    FrameParams frame{};
    frame.surface.isovalue = std::array{0.25f, 0.0f, -0.0f}[seed % 3];
    ocl::Buffer<ulong> inside(device_, "inside", num_slots);

    ZfpDecode decode(device_, num_blocks, stream.defines(), false, type);
    decode(stream, frame, counts, d_block_ids, d_slots, values, inside);

    const std::vector<float> decoded = decode_blocks_with_libzfp(volume);
    std::vector<float> expected(64 * std::size_t{num_slots}, sentinel);
    for (uint i = 0; i < start.decoded_count; ++i) {
      std::copy_n(decoded.begin() + 64 * std::ptrdiff_t(block_ids[i]), 64,
                  expected.begin() + 64 * std::ptrdiff_t(slots[i]));
    }
    EXPECT_EQ(first_other_bits(test::slot_values(values, type), expected), kNoDifference);
    expect_counts(counts, start);
    const std::vector<ulong> got_inside = inside.read();
    for (uint i = 0; i < start.decoded_count; ++i) {
      std::uint64_t expected_inside = 0;
      for (uint v = 0; v < 64; ++v)
        expected_inside |=
            std::uint64_t{expected[64 * std::size_t{slots[i]} + v] >= frame.surface.isovalue} << v;
      ASSERT_EQ(got_inside[slots[i]], expected_inside) << "request " << i;
    }
  }

  ocl::Device device_{GetParam()};
};

TEST_P(ZfpDecodeOnDevice, SmallPartialBlocksAtOddOffsets) {
  const glm::uvec3 dims(5, 6, 7);
  for (const std::uint32_t bits_per_block : {37u, 64u, 100u}) {
    expect_decoded(compress_with_libzfp(random_voxels(dims, -3, 3, 10), dims, bits_per_block), 10);
  }
}

TEST_P(ZfpDecodeOnDevice, EveryRate) {
  const glm::uvec3 dims(13, 14, 15);
  const std::vector<float> voxels = make_voxels(ValueKind::kMixed, dims, 11);
  for (const std::uint32_t bits_per_block : awkward_bits_per_block()) {
    expect_decoded(compress_with_libzfp(voxels, dims, bits_per_block), bits_per_block);
  }
}

TEST_P(ZfpDecodeOnDevice, EveryKindOfValues) {
  for (const glm::uvec3 dims :
       {glm::uvec3(5, 6, 7), glm::uvec3(2, 2, 2), glm::uvec3(4, 4, 4), glm::uvec3(41, 41, 41)}) {
    for (const ValueKind kind : kValueKinds) {
      SCOPED_TRACE(fmt::format("values {}", static_cast<int>(kind)));
      for (const std::uint32_t bits_per_block : {9u, 100u, 256u, 2048u}) {
        expect_decoded(compress_with_libzfp(make_voxels(kind, dims, 12), dims, bits_per_block), 12);
      }
    }
  }
}

TEST_P(ZfpDecodeOnDevice, DenormalsWhereTheDeviceKeepsThem) {
  if (!device_.capabilities().denormals) GTEST_SKIP() << "the device flushes denormals";
  const glm::uvec3 dims(8, 8, 8);
  for (const float scale : {1e-30f, 1e-35f, 1e-38f, 1e-41f}) {
    std::vector<float> voxels = random_voxels(dims, -1.0f, 1.0f, 13);
    for (float &v : voxels) v *= scale;
    SCOPED_TRACE(fmt::format("scale {}", scale));
    expect_decoded(compress_with_libzfp(voxels, dims, 1024), 13);
  }
}

TEST_P(ZfpDecodeOnDevice, NothingToDecodeTouchesNothing) {
  const glm::uvec3 dims(4, 4, 4);
  const DeviceStream stream(device_, compress_with_libzfp(random_voxels(dims, 0, 1, 14), dims, 64));
  CountsBuffer counts(device_, "counts", 1);  // decoded_count = 0
  const ocl::Buffer<uint> ids(device_, "block ids", 1), slots(device_, "slots", 1);
  ocl::Buffer<SlotValue> values(device_, "values", 64 * sizeof(float));
  test::fill_slots(values, SlotType::kFloat32, kSentinel);
  const FrameParams frame{};
  ocl::Buffer<ulong> inside(device_, "inside", 1);
  ZfpDecode decode(device_, 1);
  decode(stream, frame, counts, ids, slots, values, inside);
  EXPECT_EQ(test::slot_values(values), std::vector<float>(64, kSentinel));
}

/// Bits past 2^32 of the stream: the bit offset of a block does not fit 32 bits.
TEST_P(ZfpDecodeOnDevice, BlocksBehind32BitsOfBits) {
  constexpr std::uint32_t kBits = 2048,
                          kFirst = (1u << 21) + 3;  // block kFirst begins past bit 2^32
  const std::uint64_t bytes = (std::uint64_t{kFirst} + 8) * kBits / 8;
  if (bytes > device_.capabilities().largest_allocation)
    GTEST_SKIP() << "the device allocates no 512 MiB";
  const glm::uvec3 dims(8, 8, 8);
  const CompressedVolume volume = compress_with_libzfp(random_voxels(dims, -1, 1, 15), dims, kBits);
  CompressedVolume nothing;
  nothing.words.resize(1);
  nothing.bits_per_block = kBits;
  DeviceStream stream(device_, nothing);
  stream.parts[0] = ocl::Buffer<uint>(device_, "long stream", bytes / 4 + 2);
  stream.parts[0].write(volume.words, std::size_t{kFirst} * kBits / 32);
  const std::vector<uint> block_ids = {kFirst + 7, kFirst + 2}, slots = {1, 0};
  const ocl::Buffer<uint> d_block_ids(device_, "block ids", std::span<const uint>(block_ids)),
      d_slots(device_, "slots", std::span<const uint>(slots));
  PassCounts start{};
  start.decoded_count = 2;
  const CountsBuffer counts(device_, "counts", std::span<const PassCounts>(&start, 1));
  ocl::Buffer<SlotValue> values(device_, "values", 128 * sizeof(float));
  const FrameParams frame{};
  ocl::Buffer<ulong> inside(device_, "inside", 2);
  ZfpDecode decode(device_, 2);
  decode(stream, frame, counts, d_block_ids, d_slots, values, inside);
  const std::vector<float> decoded = decode_blocks_with_libzfp(volume);
  std::vector<float> expected(decoded.begin() + 2 * 64, decoded.begin() + 3 * 64);
  expected.insert(expected.end(), decoded.begin() + 7 * 64, decoded.end());
  EXPECT_EQ(first_other_bits(test::slot_values(values), expected), kNoDifference);
}

/// Values beyond the type are held at its ends; so are those of fewer bit planes.
TEST_P(ZfpDecodeOnDevice, SmallShortIntegers) {
  const glm::uvec3 dims(9, 6, 7);
  for (const VoxelType of :
       {VoxelType::kUint8, VoxelType::kInt8, VoxelType::kUint16, VoxelType::kInt16}) {
    SCOPED_TRACE(to_string(of));
    BlockPrecision precision{.min_exponent = ISO_ALL_PLANES, .whole_numbers = true};
    const auto [least, greatest] = whole_numbers_of(of, precision);
    const float margin = 0.2f * (greatest - least);
    for (const std::int32_t min_exponent : {ISO_ALL_PLANES, 4}) {
      CompressedVolume volume = compress_with_libzfp(
          random_voxels(dims, least - margin, greatest + margin, 16), dims, 1024);
      precision.min_exponent = min_exponent;
      volume.info.type = of;
      volume.precision = precision;
      const std::vector<float> decoded = decode_with_libzfp(volume);
      EXPECT_EQ(std::ranges::min(decoded), least);
      EXPECT_EQ(std::ranges::max(decoded), greatest);
      const SlotType type = slot_type_for(volume);
      EXPECT_NE(type, SlotType::kFloat32);
      expect_decoded(volume, 16, type, 17);
      expect_decoded(volume, 17, SlotType::kFloat32);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, ZfpDecodeOnDevice, testing::ValuesIn(devices_under_test()),
                         device_test_name);

}  // namespace
}  // namespace isowave::core
