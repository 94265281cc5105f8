// Volumes with a bound on the error: streams against libzfp, the index, the choice of bit planes,
// files and what is refused.

#include "core/zfp/zfp_accuracy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>

#include "core/base/error.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_file.hpp"
#include "kernels_cl/portable/zfp_codec.h"
#include "tests/array_reader.hpp"
#include "tests/run_program.hpp"
#include "tests/stage_support.hpp"
#include "tests/zfp_values.hpp"

namespace isowave::core {
namespace {

using test::read_file;
using test::TemporaryFolder;
using test::write_file;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr glm::uvec3 kDims[] = {{2, 2, 2}, {4, 4, 4}, {5, 7, 9}, {64, 33, 18}, {3, 130, 2}};
constexpr std::int32_t kExponents[] = {ISO_REVERSIBLE, -200, -30, -9, -1, 3, 200};

CompressedVolume compress_to(std::int32_t min_exponent, const glm::uvec3 &dims,
                             const std::vector<float> &voxels) {
  ArrayReader reader(dims, voxels);
  return compress(reader, CompressOptions{.precision = BlockPrecision{min_exponent}});
}

double largest_error(const CompressedVolume &volume, const std::vector<float> &source) {
  const std::vector<float> decoded = decode_with_libzfp(volume);
  double error = 0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    error = std::max(error, std::abs(double{decoded[i]} - double{source[i]}));
  }
  return error;
}

void expect_same(const CompressedVolume &got, const CompressedVolume &expected) {
  EXPECT_EQ(got.words, expected.words);
  EXPECT_EQ(got.index, expected.index);
  EXPECT_EQ(got.indexed_bits, expected.indexed_bits);
  EXPECT_EQ(got.precision.min_exponent, expected.precision.min_exponent);
  EXPECT_EQ(got.precision.whole_numbers, expected.precision.whole_numbers);
}

// ---- streams

TEST(ErrorBoundCoder, SameStreamAsLibzfpOnTheWholeArray) {
  for (const glm::uvec3 &dims : kDims) {
    for (const ValueKind kind : kValueKinds) {
      const std::vector<float> voxels = make_voxels(kind, dims, 1);
      for (const std::int32_t exponent : kExponents) {
        SCOPED_TRACE(fmt::format("{}x{}x{}, values {}, planes to 2^{}", dims.x, dims.y, dims.z,
                                 static_cast<int>(kind), exponent));
        std::vector<float> stored = voxels;
        for (float &voxel : stored) {
          const bool is_tiny = voxel != 0 && std::abs(voxel) < kMinMagnitude;
          if (is_tiny && exponent != ISO_REVERSIBLE) voxel = 0.0f;
        }
        expect_same(compress_to(exponent, dims, voxels),
                    compress_with_libzfp(stored, dims, 0, exponent));
      }
    }
  }
}

TEST(ErrorBoundCoder, ManyChunksAndAnyThreadCount) {
  const glm::uvec3 dims(700, 701, 19);  // more than one chunk of layers
  const std::vector<float> voxels = random_voxels(dims, -1, 1, 2);
  ArrayReader reader(dims, voxels);
  CompressOptions options{.precision = BlockPrecision{-3}};
  options.input.num_threads = 1;
  const CompressedVolume one = compress(reader, options);
  options.input.num_threads = 5;
  expect_same(compress(reader, options), one);
  expect_same(one, compress_with_libzfp(voxels, dims, 0, -3));
}

TEST(ErrorBoundCoder, EmptyBlocksAreABitAndConstantOnesAlmostNothing) {
  const glm::uvec3 dims(64, 64, 64);
  const CompressedVolume zeros = compress_to(-1, dims, std::vector<float>(64 * 64 * 64, 0.0f));
  EXPECT_EQ(zeros.payload_bits(), zeros.block_count());
  const CompressedVolume constant = compress_to(-1, dims, std::vector<float>(64 * 64 * 64, 100.0f));
  EXPECT_LT(constant.rate(), 1.0);
  EXPECT_EQ(constant.index.size(), block_index_words(constant.block_count()));
}

TEST(ErrorBoundCoder, DecodedOnTheHostAsByLibzfp) {
  for (const glm::uvec3 &dims : kDims) {
    for (const ValueKind kind : kValueKinds) {
      for (const std::int32_t exponent : kExponents) {
        SCOPED_TRACE(fmt::format("{}x{}x{}, values {}, planes to 2^{}", dims.x, dims.y, dims.z,
                                 static_cast<int>(kind), exponent));
        const CompressedVolume volume =
            compress_with_libzfp(make_voxels(kind, dims, 3), dims, 0, exponent);
        const std::vector<float> expected = decode_blocks_with_libzfp(volume);
        std::vector<float> values(expected.size());
        for (std::uint32_t b = 0; b < volume.block_count(); ++b) {
          zfp_decode_any_block(volume.words.data(), volume.block_begin(b), volume.block_bits(b),
                               exponent, values.data() + 64 * std::size_t{b});
        }
        EXPECT_EQ(std::memcmp(values.data(), expected.data(), values.size() * sizeof(float)), 0);
      }
    }
  }
}

/// A coarser bound is a prefix of every block: what precision on demand rests on.
TEST(ErrorBoundCoder, FewerPlanesOfAFinerStreamAreTheCoarserStream) {
  const glm::uvec3 dims(16, 12, 8);
  const std::vector<float> voxels = make_voxels(ValueKind::kMixed, dims, 4);
  const CompressedVolume fine = compress_with_libzfp(voxels, dims, 0, -25);
  for (const std::int32_t exponent : {-20, -8, 0, 60}) {
    const std::vector<float> expected =
        decode_blocks_with_libzfp(compress_with_libzfp(voxels, dims, 0, exponent));
    for (std::uint32_t b = 0; b < fine.block_count(); ++b) {
      float values[64];
      zfp_decode_block(fine.words.data(), fine.block_begin(b), fine.block_bits(b), exponent,
                       values);
      EXPECT_EQ(std::memcmp(values, expected.data() + 64 * std::size_t{b}, sizeof(values)), 0)
          << "block " << b << ", planes to 2^" << exponent;
    }
  }
}

TEST(ErrorBoundCoder, RandomBitsAreNoLongerThanABlockCanBe) {
  Random random(8);
  CompressedVolume volume;
  volume.info.dims = glm::uvec3(64, 64, 64);
  volume.words.resize(volume.block_count() * ISO_MAX_BLOCK_BITS / 32 + 100);
  std::generate(volume.words.begin(), volume.words.end(), std::ref(random));
  for (const std::int32_t exponent : kExponents) {
    volume.precision.min_exponent = exponent;
    volume.indexed_bits = 32 * volume.words.size();
    volume.index = index_by_decoding(volume);
    const std::vector<float> expected = decode_blocks_with_libzfp(volume);
    for (std::uint32_t b = 0; b < volume.block_count(); ++b) {
      ASSERT_LE(volume.block_bits(b), ISO_MAX_BLOCK_BITS);
      float values[64];
      zfp_decode_any_block(volume.words.data(), volume.block_begin(b), volume.block_bits(b),
                           exponent, values);
      ASSERT_EQ(std::memcmp(values, expected.data() + 64 * std::size_t{b}, sizeof(values)), 0)
          << "block " << b;
    }
  }
}

// ---- reversible streams

/// Bits of float32 that no common exponent has: -0, denormals, the largest, and any among others.
std::vector<float> odd_floats(const glm::uvec3 &dims, uint seed) {
  const float odd[] = {-0.0f, 0.0f, 1e-45f, -1e-40f, 0x1p-126f, 3.4e38f, -3.4e38f, 1.0f, -1e20f};
  Random random(seed);
  std::vector<float> voxels = random_voxels(dims, -1, 1, seed);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    const std::size_t block = i / 64 % 8;
    if (block < 6 && random() % (block + 1) == 0) voxels[i] = odd[random() % std::size(odd)];
    if (block == 6) voxels[i] = std::bit_cast<float>(std::uint32_t(random() & 0xBF7FFFFFu));
    if (block == 7) voxels[i] = -0.0f;
  }
  return voxels;
}

TEST(Reversible, AnyFiniteFloatIsDecodedAsByLibzfp) {
  for (const glm::uvec3 &dims : kDims) {
    for (uint seed = 1; seed < 5; ++seed) {
      SCOPED_TRACE(fmt::format("{}x{}x{}, seed {}", dims.x, dims.y, dims.z, seed));
      const std::vector<float> voxels = odd_floats(dims, seed);
      const CompressedVolume volume = compress_with_libzfp(voxels, dims, 0, ISO_REVERSIBLE);
      const std::vector<float> decoded = decode_with_libzfp(volume);
      EXPECT_EQ(std::memcmp(decoded.data(), voxels.data(), voxels.size() * sizeof(float)), 0);
      const std::vector<float> expected = decode_blocks_with_libzfp(volume);
      for (std::uint32_t b = 0; b < volume.block_count(); ++b) {
        float values[64];
        zfp_decode_any_block(volume.words.data(), volume.block_begin(b), volume.block_bits(b),
                             ISO_REVERSIBLE, values);
        ASSERT_EQ(std::memcmp(values, expected.data() + 64 * std::size_t{b}, sizeof(values)), 0)
            << "block " << b;
      }
    }
  }
}

/// Those below 2^126, which are compressed here.
std::vector<float> float_voxels(const glm::uvec3 &dims, uint seed) {
  std::vector<float> voxels = odd_floats(dims, seed);
  for (float &voxel : voxels) {
    if (std::abs(voxel) >= kMaxMagnitude) voxel = -0x1p125f;
  }
  return voxels;
}

TEST(Reversible, IsTheDefaultOfFloatsAndKeepsTheirBits) {
  for (const glm::uvec3 &dims : kDims) {
    const std::vector<float> voxels = float_voxels(dims, 3);
    ArrayReader reader(dims, voxels);
    for (const ErrorGoal &goal : {ErrorGoal{}, ErrorGoal{.exact = true}}) {
      const BlockPrecision chosen = choose_precision(reader, goal, {});
      EXPECT_TRUE(chosen.is_reversible());
      const CompressedVolume volume = compress(reader, {.precision = chosen});
      EXPECT_EQ(volume.max_voxel_error, 0.0);
      const std::vector<float> decoded = decode_with_libzfp(volume);
      EXPECT_EQ(std::memcmp(decoded.data(), voxels.data(), voxels.size() * sizeof(float)), 0);
    }
  }
}

/// A voxel of 1e20 among others takes bits from its block, and no accuracy.
TEST(Reversible, OutliersSpoilNoNeighbours) {
  const glm::uvec3 dims(24, 22, 20);
  std::vector<float> voxels = make_voxels(ValueKind::kSmooth, dims, 1);
  for (std::size_t i = 7; i < voxels.size(); i += 501) voxels[i] = 1e20f;
  ArrayReader reader(dims, voxels);
  const CompressedVolume volume = compress(reader, {.precision = choose_precision(reader, {}, {})});
  EXPECT_EQ(decode_with_libzfp(volume), voxels);
}

TEST(Reversible, OfDoublesOnlyFloat32LosesSomething) {
  const glm::uvec3 dims(9, 8, 7);
  std::vector<double> voxels(9 * 8 * 7);
  for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = std::sin(0.1 * double(i));
  double lost = 0;
  for (const double voxel : voxels) lost = std::max(lost, std::abs(double(float(voxel)) - voxel));
  ArrayReader reader(dims, voxels, VoxelType::kFloat64);
  const CompressedVolume volume = compress(reader, {.precision = choose_precision(reader, {}, {})});
  ASSERT_TRUE(volume.max_voxel_error);
  EXPECT_GE(*volume.max_voxel_error, lost);
  EXPECT_LE(*volume.max_voxel_error, lost * 1.001);
  EXPECT_THAT([&] { choose_precision(reader, {.exact = true}, {}); },
              ThrowsMessage<Error>(HasSubstr("type float64 would be off by up to")));
  for (double &voxel : voxels) voxel = std::rint(1000 * voxel);
  ArrayReader whole(dims, voxels, VoxelType::kFloat64);
  EXPECT_TRUE(choose_precision(whole, {.exact = true}, {}).is_reversible());
  ArrayReader integers(dims, voxels, VoxelType::kInt64);
  EXPECT_TRUE(choose_precision(integers, {}, {}).whole_numbers);
  for (double &voxel : voxels) voxel *= 1e-50;
  ArrayReader tiny(dims, voxels, VoxelType::kFloat64);
  EXPECT_THAT([&] { choose_precision(tiny, {}, {}); },
              ThrowsMessage<Error>(HasSubstr("float32 holds them within")));
  for (double &voxel : voxels) voxel = std::rint(voxel * 1e50);
  voxels[5] = 0x1p40;  // float32 holds this one, too
  ArrayReader large(dims, voxels, VoxelType::kInt64);
  EXPECT_TRUE(choose_precision(large, {.exact = true}, {}).is_reversible());
}

TEST(Reversible, HasNoBitPlanesToSpare) {
  const BlockPrecision bound{ISO_REVERSIBLE, false, {}};
  EXPECT_TRUE(with_fewer_planes(bound, 0.5).is_reversible());
  EXPECT_EQ(plane_error(bound, 0.5), 0.0);
}

// ---- the choice of bit planes

TEST(ChooseErrorBound, TheFewestPlanesWithinTheTolerance) {
  for (const glm::uvec3 &dims : kDims) {
    for (const ValueKind kind : {ValueKind::kRandom, ValueKind::kSmooth, ValueKind::kConstant}) {
      const std::vector<float> voxels = make_voxels(kind, dims, 5);
      for (const double tolerance : {1e-4, 0.01, 0.3}) {
        SCOPED_TRACE(fmt::format("{}x{}x{}, values {}, tolerance {}", dims.x, dims.y, dims.z,
                                 static_cast<int>(kind), tolerance));
        ArrayReader reader(dims, voxels);
        const BlockPrecision chosen = choose_precision(reader, {tolerance}, {});
        const double error = largest_error(compress_to(chosen.min_exponent, dims, voxels), voxels);
        EXPECT_LE(error, tolerance);
        EXPECT_EQ(chosen.max_voxel_error, error);
        EXPECT_FALSE(chosen.whole_numbers);
        // What was tried: from zfp's promise up to six planes fewer.
        const std::int32_t promise = std::ilogb(tolerance);
        ASSERT_GE(chosen.min_exponent, promise);
        for (std::int32_t coarser = chosen.min_exponent + 1; coarser <= promise + 6; ++coarser) {
          EXPECT_GT(largest_error(compress_to(coarser, dims, voxels), voxels), tolerance)
              << "planes to 2^" << coarser;
        }
      }
    }
  }
}

TEST(ChooseErrorBound, AnyThreadCount) {
  const glm::uvec3 dims(130, 90, 40);
  ArrayReader reader(dims, random_voxels(dims, -1, 1, 6));
  for (const double tolerance : {0.02, 0.0005}) {
    InputOptions options;
    options.num_threads = 1;
    const BlockPrecision one = choose_precision(reader, {tolerance}, options);
    options.num_threads = 7;
    const BlockPrecision seven = choose_precision(reader, {tolerance}, options);
    EXPECT_EQ(seven.min_exponent, one.min_exponent);
    EXPECT_EQ(seven.max_voxel_error, one.max_voxel_error);
  }
}

TEST(ChooseErrorBound, ExactIsTheSourceBitForBit) {
  const glm::uvec3 dims(21, 18, 13);
  struct Case {
    VoxelType type;
    float begin, end;
  };
  for (const Case &c : {Case{VoxelType::kUint8, 0, 255},
                        {VoxelType::kInt16, -32768, 32767},
                        {VoxelType::kUint8, 0, 1},
                        {VoxelType::kInt32, -16777215, 16777215},
                        {VoxelType::kUint32, 16777000, 16777215}}) {
    SCOPED_TRACE(fmt::format("{} to {}", c.begin, c.end));
    std::vector<float> voxels = random_voxels(dims, c.begin, c.end, 7);
    for (float &voxel : voxels) voxel = std::rint(voxel) + 0.0f;
    ArrayReader reader(dims, voxels);
    reader.mutable_info().type = c.type;
    const BlockPrecision chosen = choose_precision(reader, {.exact = true}, {});
    EXPECT_EQ(chosen.max_voxel_error, 0.0);
    const CompressedVolume volume = compress(reader, CompressOptions{.precision = chosen});
    const std::vector<float> decoded = decode_with_libzfp(volume);
    EXPECT_EQ(std::memcmp(decoded.data(), voxels.data(), voxels.size() * sizeof(float)), 0);
    // One plane fewer is not enough, or zfp's promise of a quarter was beaten by all that is tried.
    CompressedVolume coarser = compress_to(chosen.min_exponent + 1, dims, voxels);
    coarser.precision.whole_numbers = true;
    if (chosen.min_exponent < 4) {
      EXPECT_GT(largest_error(coarser, voxels), 0.0);
    }
  }
}

TEST(ChooseErrorBound, WhatCannotBeIsOneLine) {
  const glm::uvec3 dims(8, 8, 8);
  ArrayReader reader(dims, random_voxels(dims, -1, 1, 9));
  for (const double tolerance : {0.0, -1.0, double{NAN}, double{INFINITY}}) {
    EXPECT_THAT([&] { choose_precision(reader, {tolerance}, {}); },
                ThrowsMessage<Error>(HasSubstr("above 0")));
  }
  EXPECT_THAT([&] { choose_precision(reader, {1e-30}, {}); },
              ThrowsMessage<Error>(HasSubstr("cannot be kept")));
  std::vector<float> large(512, 5.0f);
  large[77] = INFINITY;
  ArrayReader with_infinity(dims, large);
  EXPECT_THAT([&] { choose_precision(with_infinity, {0.1}, {}); },
              ThrowsMessage<Error>(HasSubstr("1 of 512 voxels")));
  InputOptions mapped;
  mapped.map_nan = 4.0f;
  EXPECT_NO_THROW(choose_precision(with_infinity, {0.1}, mapped));
}

// ---- files

TEST(ErrorBoundFile, KeepsAllAndZfpsOwnToolDecodesIt) {
  for (const glm::uvec3 &dims : kDims) {
    for (const std::int32_t exponent : {ISO_REVERSIBLE, -200, -5, 200}) {
      SCOPED_TRACE(fmt::format("{}x{}x{}, planes to 2^{}", dims.x, dims.y, dims.z, exponent));
      const TemporaryFolder folder;
      ArrayReader reader(dims, make_voxels(ValueKind::kMixed, dims, 11));
      reader.mutable_info().spacing = {1, 2, 3};
      const CompressOptions options{.precision = BlockPrecision{exponent, false, 0.125}};
      compress_to_file(reader, options, folder / "a.zfp");
      const CompressedVolume in_memory = compress(reader, options);
      for (const CompressedVolume &read :
           {read_zfp_file(folder / "a.zfp"), open_zfp_file(folder / "a.zfp")}) {
        EXPECT_EQ(read.info.spacing, glm::dvec3(1, 2, 3));
        EXPECT_EQ(read.max_voxel_error, 0.125);
        EXPECT_EQ(read.value_range, in_memory.value_range);
        EXPECT_EQ(read.index, in_memory.index);
        std::vector<std::uint32_t> words(in_memory.words.size());
        read.read_words(0, words);
        EXPECT_EQ(words, in_memory.words);
      }
      EXPECT_EQ(read_zfp_file_info(folder / "a.zfp").rate(), in_memory.rate());
      const auto run = test::run_command(fmt::format(
          "zfp -q -h -z '{}' -o '{}'", (folder / "a.zfp").string(), (folder / "a.f32").string()));
      ASSERT_EQ(run.status, 0) << run.err;
      const std::vector<float> ours = decode_with_libzfp(in_memory);
      const std::string theirs = read_file(folder / "a.f32");
      ASSERT_EQ(theirs.size(), ours.size() * sizeof(float));
      EXPECT_EQ(std::memcmp(theirs.data(), ours.data(), theirs.size()), 0);
    }
  }
}

TEST(ErrorBoundFile, FilesOfZfpsOwnTool) {
  const TemporaryFolder folder;
  const glm::uvec3 dims(37, 18, 23);
  const std::vector<float> voxels = make_voxels(ValueKind::kSmooth, dims, 12);
  write_file(folder / "raw",
             std::string_view(reinterpret_cast<const char *>(voxels.data()), voxels.size() * 4));
  const std::string packed = (folder / "a.zfp").string();
  const auto run = test::run_command(fmt::format("zfp -q -h -f -3 37 18 23 -a 0.03 -i '{}' -z '{}'",
                                                 (folder / "raw").string(), packed));
  ASSERT_EQ(run.status, 0) << run.err;
  const CompressedVolume volume = read_zfp_file(packed);
  expect_same(volume, compress_to(-6, dims, voxels));  // 2^-6 <= 0.03
  const std::string bytes = read_file(packed);
  write_file(folder / "cut.zfp", bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT([&] { read_zfp_file(folder / "cut.zfp"); },
              ThrowsMessage<Error>(HasSubstr("truncated")));
  write_file(folder / "more.zfp", bytes + std::string(9, '\0'));
  EXPECT_THAT([&] { read_zfp_file(folder / "more.zfp"); },
              ThrowsMessage<Error>(HasSubstr("unknown bytes")));
}

class DamagedErrorBoundFile : public testing::Test {
 protected:
  DamagedErrorBoundFile() {
    ArrayReader reader({14, 9, 6}, make_voxels(ValueKind::kMixed, {14, 9, 6}, 13));
    volume_ = compress(reader, {.precision = BlockPrecision{-4}});
    write(volume_);
    right_ = read_file(folder_ / "a.zfp");
  }
  void write(const CompressedVolume &volume) {
    ZfpFileWriter file(folder_ / "a.zfp", volume);
    file.write(std::as_bytes(std::span(volume_.words).first(volume_.words.size() - 2)));
    file.commit(volume);
  }

  TemporaryFolder folder_;
  CompressedVolume volume_;
  std::string right_;
};

TEST_F(DamagedErrorBoundFile, AnyFlippedBitIsNoticed) {
  constexpr std::size_t kHeaderBits = 12 * 8, kFooterBits = 24 * 8;
  for (std::size_t bit = 0; bit < right_.size() * 8; ++bit) {
    const bool in_the_middle = bit >= kHeaderBits && bit < right_.size() * 8 - kFooterBits;
    if (in_the_middle && bit % 8 != bit / 8 * 5 % 8)
      continue;  // of each byte there one: seconds, not minutes
    std::string wrong = right_;
    wrong[bit / 8] = char(wrong[bit / 8] ^ (1 << bit % 8));
    write_file(folder_ / "b.zfp", wrong);
    EXPECT_THROW(read_zfp_file(folder_ / "b.zfp"), Error) << "bit " << bit;
  }
}

TEST_F(DamagedErrorBoundFile, AnyCutIsNoticedButTheLossOfTheWholeTrailer) {
  const std::size_t stream_end = 12 + (volume_.payload_bits() + 7) / 8,
                    plain_zfp = (stream_end + 7) / 8 * 8;
  for (std::size_t length = 0; length < right_.size(); ++length) {
    write_file(folder_ / "b.zfp", right_.substr(0, length));
    if (length >= stream_end && length <= plain_zfp) {
      EXPECT_NO_THROW(read_zfp_file(folder_ / "b.zfp"))
          << "a plain zfp file of " << length << " bytes";
    } else {
      EXPECT_THROW(read_zfp_file(folder_ / "b.zfp"), Error) << "cut to " << length;
    }
  }
}

/// Its checksums are right, and it lies.
TEST_F(DamagedErrorBoundFile, LyingLengthsAreRefused) {
  const auto index_of = [&](auto length_of) {
    BlockIndexBuilder index;
    for (std::uint32_t b = 0; b < volume_.block_count(); ++b) index.add(length_of(b));
    return index.finish();
  };
  const auto expect_refused = [&](const CompressedVolume &lying, const char *text) {
    write(lying);
    EXPECT_THAT([&] { read_zfp_file(folder_ / "a.zfp"); }, ThrowsMessage<Error>(HasSubstr(text)));
  };
  CompressedVolume lying = volume_;
  lying.index = index_of([&](std::uint32_t b) { return volume_.block_bits(b) + (b == 3 ? 1 : 0); });
  expect_refused(lying, "not those of its stream");
  lying.index = index_of([&](std::uint32_t b) { return b == 3 ? 0 : volume_.block_bits(b); });
  expect_refused(lying, "not those of its stream");
  lying.index = index_of(
      [&](std::uint32_t b) { return b == 3 ? ISO_MAX_BLOCK_BITS + 1 : volume_.block_bits(b); });
  expect_refused(lying, "not those of its stream");
  lying = volume_;
  for (const std::uint64_t bits :
       {std::uint64_t{0}, volume_.indexed_bits + 64, std::uint64_t{1} << 63}) {
    lying.indexed_bits = bits;
    expect_refused(lying, "not as long as its trailer says");
  }
}

}  // namespace
}  // namespace isowave::core
