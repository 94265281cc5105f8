// Compressed files that lie, with checksums that are right, that become shorter while they are
// read, or that would take more memory than they are worth: the program says so in one line, or
// draws what its reference draws.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/base/error.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/libzfp.hpp"
#include "core/zfp/zfp_accuracy.hpp"
#include "core/zfp/zfp_file.hpp"
#include "tests/frame_scene.hpp"
#include "tests/volume_file.hpp"
#include "tests/zfp_trailer_file.hpp"

namespace isowave::core {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::quoted;
using test::TemporaryFolder;
using test::TrailerFile;
using test::with_trailer;
using testing::AnyOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

constexpr std::optional<std::int32_t> kKinds[] = {std::nullopt, -8, ISO_REVERSIBLE};

class HostileZfp : public testing::Test {
 protected:
  /// A small volume with levels, as a file: of a fixed rate, or of blocks with these bit planes.
  std::string make(std::optional<std::int32_t> min_exponent) {
    ArrayReader source(test::grid_info({18, 17, 19}),
                       test::sample({18, 17, 19}, test::gyroid_field(9)));
    CompressOptions options{.rate = 6, .measure_error = true, .levels = 2};
    if (min_exponent) options.precision = BlockPrecision{*min_exponent};
    compress_to_file(source, options, path_);
    return test::read_file(path_);
  }
  std::string header(const glm::uvec3 &dims, std::int32_t min_exponent) {
    const ZfpHeader words = make_zfp_header(dims, 0, min_exponent);
    return {reinterpret_cast<const char *>(words.data()), sizeof(words)};
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_ / "a.zfp";
};

/// A program with sanitizers needs more memory than its own.
bool has_sanitizers(const std::string &program) {
  return program.find("_sanitized") != std::string::npos;
}

/// A command that gets no more memory, unless it has sanitizers.
std::string in_400_mb(const std::string &program) {
  return (has_sanitizers(program) ? "" : "ulimit -v 400000; ") + program;
}

// ---- files that become shorter

TEST_F(HostileZfp, CutWhereverAfterItWasOpened) {
  for (const auto &kind : kKinds) {
    const std::string bytes = make(kind);
    const CompressedVolume volume = open_zfp_file(path_);
    const std::uint64_t end = 12 + (volume.payload_bits() + 7) / 8;
    const std::vector<float> expected = decode_with_libzfp(volume);
    for (std::uint64_t cut = bytes.size(); cut-- > 0;) {
      fs::resize_file(path_, cut);
      if (cut >= end) continue;
      ASSERT_THAT([&] { decode_with_libzfp(volume); },
                  ThrowsMessage<Error>(HasSubstr("truncated while it was in use")))
          << cut;
      cut -= std::min<std::uint64_t>(cut, 6);
    }
    test::write_file(path_, bytes);
    EXPECT_EQ(decode_with_libzfp(volume), expected) << "written again, in place";
    fs::remove(path_);
    EXPECT_EQ(decode_with_libzfp(volume), expected) << "no longer there by its name";
  }
}

/// However it falls out: an answer or one line, never a signal.
TEST_F(HostileZfp, CutWhileTheProgramReadsIt) {
  const std::string bytes = make(-8);
  std::atomic<bool> done = false;
  std::thread cutter([&] {
    for (std::uint64_t turn = 0; !done; ++turn) {
      fs::resize_file(path_, bytes.size() * (turn % 7) / 7);
      test::write_file(folder_ / "b", bytes);
      fs::rename(folder_ / "b", path_);
    }
  });
  for (int run = 0; run < 25; ++run) {
    const auto result = test::run_isowave("info " + quoted(path_));
    EXPECT_LE(result.status, 1) << result.err;
    EXPECT_LE(std::ranges::count(result.err, '\n'), 1) << result.err;
  }
  done = true;
  cutter.join();
}

// ---- more than they are worth

/// 268 million empty blocks in 32 MiB: their index would take 671 MB.
TEST_F(HostileZfp, EmptyBlocksAreCountedInLittleMemory) {
  test::write_file(path_, header({4096, 4096, 1024}, 0));
  fs::resize_file(path_, 12 + (1ull << 28) / 8 + 4);
  const auto result =
      test::run_command(in_400_mb(test::isowave_program()) + " info " + quoted(path_));
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("268,435,456"));
  if (!has_sanitizers(test::isowave_program())) {
    EXPECT_THAT(result.out, HasSubstr("needs more memory"));
  }
  fs::resize_file(path_, 12 + (1ull << 28) / 8 - 4);
  test::expect_one_line_error("info " + quoted(path_), "truncated");
}

/// 2^30 of them, one more than there are ids: the index would take 2.7 GB.
TEST_F(HostileZfp, MoreBlocksThanIdsAreRefusedBeforeTheirIndexIsBuilt) {
  test::write_file(path_, header({4096, 4096, 4096}, 0));
  fs::resize_file(path_, 12 + (1ull << 30) / 8 + 4);
  for (const std::string arguments :
       {"render --reference -i 0 --size 8x8 ", "verify -i 0 --size 8x8 "}) {
    const auto result =
        test::run_command(in_400_mb(test::isowave_program()) + " " + arguments + quoted(path_));
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
    EXPECT_THAT(result.err, HasSubstr("1073741824 blocks cannot be drawn"));
  }
}

TEST_F(HostileZfp, EmptyAndOtherBlocksAreFoundAlike) {
  std::vector<float> voxels = test::sample({64, 36, 21}, test::gyroid_field(9));
  for (std::size_t i = 0; i < voxels.size(); ++i)
    if (i % 64 / 4 % 5 < 3 || i / 64 % 36 < 13) voxels[i] = 0;
  ArrayReader source(test::grid_info({64, 36, 21}), voxels);
  const CompressedVolume volume = compress(source, {.precision = BlockPrecision{-6}});
  std::uint32_t block = 0;
  find_block_lengths(volume, "a test", [&](const FoundBlocks &found) {
    for (std::uint64_t i = 0; i < found.count; ++i)
      EXPECT_EQ(found.bits, volume.block_bits(block++));
  });
  EXPECT_EQ(block, volume.block_count());
}

TEST_F(HostileZfp, MoreBlocksThanBitsAreRefusedFirst) {
  for (const glm::uvec3 &dims :
       {glm::uvec3(65536), glm::uvec3(4096, 4096, 4096), glm::uvec3(65536, 65536, 2)}) {
    const std::string head = header(dims, 0), payload(2000, 0);
    test::write_file(path_, head + payload);
    const auto result =
        test::run_command(in_400_mb(test::isowave_program()) + " info " + quoted(path_));
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
    json trailer = json::parse(TrailerFile(make(-8)).text);
    trailer.erase("level_bytes");
    trailer.erase("bounds_bytes");
    const std::string index = test::zlib(std::string(20'000, '\1'));
    trailer["payload_bits"] = 8 * payload.size();
    trailer["index_bytes"] = index.size();
    test::write_file(path_,
                     with_trailer(head + payload + std::string(4, 0) + index, trailer.dump(), 2));
    EXPECT_THROW(open_zfp_file(path_), Error);
  }
}

/// Levels within levels: each a file of its own, whose trailer says that it has one, too.
TEST_F(HostileZfp, LevelsOfLevelsAreRefusedAtOnce) {
  const ZfpHeader words = make_zfp_header({2, 2, 2}, 64);
  const std::string head(reinterpret_cast<const char *>(words.data()), sizeof(words));
  const std::string grid =
      R"("spacing":[1,1,1],"origin":[0,0,0],"type":"uint8","direction":[[1,0,0],[0,1,0],[0,0,1]])";
  std::string file = with_trailer(head + std::string(12, 0), "{" + grid + "}", 4);
  while (file.size() < 1'500'000) {
    const std::string level_bytes = fmt::format(R"(,"level_bytes":[{}])", file.size());
    file = with_trailer(head + std::string(12, 0) + file, "{" + grid + level_bytes + "}", 4);
  }
  test::write_file(path_, file);
  EXPECT_THAT([&] { open_zfp_file(path_); },
              ThrowsMessage<Error>(HasSubstr("one of its levels of detail is none")));
}

// ---- trailers that lie

TEST_F(HostileZfp, FieldsOfAnyKindAreReadOrRefusedInOneLine) {
  const std::vector<std::string> values = {"null",
                                           "true",
                                           "\"x\\ny\"",
                                           '"' + std::string(5000, 'x') + '"',
                                           "-1",
                                           "0",
                                           "1",
                                           "65535",
                                           "4294967296",
                                           "18446744073709551615",
                                           "1e300",
                                           "-1e300",
                                           "1e-320",
                                           "0.5",
                                           "[]",
                                           "{}",
                                           "[1]",
                                           "[1,2]",
                                           "[2,1]",
                                           "[1e300,2e300]",
                                           "[[1,0,0],[0,1,0],[0,0,0]]",
                                           "[0,0,0]",
                                           "[1,1,1]",
                                           "[1e300,1e300,1e300]",
                                           "[[[[[[[[]]]]]]]]",
                                           "[18446744073709551615]",
                                           "[1,1]"};
  std::size_t num_read = 0, num_refused = 0;
  for (const auto &kind : kKinds) {
    const TrailerFile parts(make(kind));
    const json trailer = json::parse(parts.text);
    for (const auto &[key, right] : trailer.items()) {
      for (const std::string &value : values) {
        json changed = trailer;
        changed[key] = json::parse(value);
        test::write_file(path_, with_trailer(parts.before, changed.dump(), parts.version));
        try {
          const CompressedVolume volume = open_zfp_file(path_);
          EXPECT_TRUE(!volume.max_voxel_error ||
                      (*volume.max_voxel_error >= 0 && std::isfinite(*volume.max_voxel_error)));
          EXPECT_LE(volume.value_range[0], volume.value_range[1]);
          decode_with_libzfp(volume);
          ++num_read;
        } catch (const Error &error) {
          EXPECT_THAT(error.what(), Not(AnyOf(HasSubstr("\n"), HasSubstr("exception"))));
          EXPECT_LT(std::string_view(error.what()).size(), 300u) << error.what();
          ++num_refused;
        }
      }
    }
  }
  EXPECT_GT(num_read, 10u);
  EXPECT_GT(num_refused, 400u);
}

/// Deflated parts end where the trailer says, and with the last block.
TEST_F(HostileZfp, DeflatedPartsEndWithTheirBlocks) {
  ArrayReader source(test::grid_info({18, 17, 19}),
                     test::sample({18, 17, 19}, test::gyroid_field(9)));
  compress_to_file(source, {.precision = BlockPrecision{-8}, .levels = 2}, path_);
  const TrailerFile parts(test::read_file(path_));
  const CompressedVolume volume = open_zfp_file(path_);
  const std::size_t stream_bytes = (96 + volume.payload_bits() + 63) / 64 * 8;
  const json trailer = json::parse(parts.text);
  std::string lengths, codes(volume.bounds.codes.begin(), volume.bounds.codes.end());
  for (std::uint32_t block = 0; block < volume.block_count(); ++block) {
    const auto length = static_cast<std::uint16_t>(volume.block_bits(block));
    lengths.append(reinterpret_cast<const char *>(&length), sizeof(length));
  }
  const std::size_t old_bytes =
      trailer["index_bytes"].get<std::size_t>() + trailer["bounds_bytes"].get<std::size_t>();
  const std::string stream = parts.before.substr(0, stream_bytes),
                    levels = parts.before.substr(stream_bytes + old_bytes);
  const auto is_read = [&](const std::string &index, const std::string &bounds) {
    json changed = trailer;
    changed["index_bytes"] = index.size();
    changed["bounds_bytes"] = bounds.size();
    test::write_file(path_,
                     with_trailer(stream + index + bounds + levels, changed.dump(), parts.version));
    try {
      open_zfp_file(path_);
      return true;
    } catch (const Error &) {
      return false;
    }
  };
  const std::string index = test::zlib(lengths), bounds = test::zlib(codes);
  EXPECT_TRUE(is_read(index, bounds));
  EXPECT_FALSE(is_read(index + "x", bounds));
  EXPECT_FALSE(is_read(index, bounds + "x"));
  EXPECT_FALSE(is_read(test::zlib(lengths + "xx"), bounds));
  EXPECT_FALSE(is_read(index, test::zlib(codes + "x")));
  EXPECT_FALSE(is_read(index.substr(0, index.size() - 1), bounds));
  EXPECT_FALSE(is_read(test::gzip(lengths), bounds));
  for (std::string *part : {&lengths, &codes}) part->pop_back();
  EXPECT_FALSE(is_read(test::zlib(lengths), bounds));
  EXPECT_FALSE(is_read(index, test::zlib(codes)));
  std::string flipped = index;
  flipped.back() ^= 1;  // of its checksum
  EXPECT_FALSE(is_read(flipped, bounds));
}

/// Files of programs that did not count casts, whose errors are said too small.
TEST_F(HostileZfp, ErrorsThatLeaveOutTheCastAreNotKnown) {
  for (const std::string kind : {"float64", "int32", "float32"}) {
    for (const std::string compression : {"--rate 6", "--tolerance-relative 0.01"}) {
      const auto run = test::run_isowave("convert generate:gyroid_18x17x19_" + kind +
                                         " --levels 2 " + compression + " -o " + quoted(path_));
      ASSERT_EQ(run.status, 0) << run.err;
      const CompressedVolume right = open_zfp_file(path_);
      EXPECT_TRUE(known_voxel_error(right));
      EXPECT_FALSE(right.bounds.codes.empty());
      const TrailerFile parts(test::read_file(path_));
      json trailer = json::parse(parts.text);
      const bool had_casts = trailer.erase("cast_counts") > 0;
      EXPECT_EQ(had_casts, kind != "float32");
      test::write_file(path_, with_trailer(parts.before, trailer.dump(), parts.version));
      for (const CompressedVolume &read : {open_zfp_file(path_), read_zfp_file_info(path_)}) {
        EXPECT_EQ(known_voxel_error(read), had_casts ? std::nullopt : right.max_voxel_error);
      }
      const CompressedVolume read = open_zfp_file(path_);
      EXPECT_EQ(read.bounds.codes.empty(), had_casts);
      EXPECT_EQ(read.coarser_levels[0].bounds.codes.empty(), had_casts);
    }
  }
}

// ---- advice

/// What a frame that cannot be kept within an error says would help, `convert` takes, and it is
/// less than there is.
TEST_F(HostileZfp, AdviceCanBeFollowed) {
  const auto constant = folder_ / "c_16x16x16_float32.raw",
             ramp = folder_ / "r_16x16x16_float32.raw", high = folder_ / "h_16x16x16_float64.raw";
  test::write_file(constant, std::vector<float>(4096, 3.0f));
  std::vector<float> values(4096);
  std::vector<double> high_values(4096);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = float(i % 16) + 0.01f * float(i * 7919 % 101);
    high_values[i] = 1e7 + values[i];
  }
  test::write_file(ramp, values);
  test::write_file(high, high_values);
  std::size_t num_advised = 0;
  for (const auto &[voxels, isovalue] : {std::pair(constant, "3"), std::pair(constant, "2.5"),
                                         std::pair(ramp, "7.3"), std::pair(high, "10000007")}) {
    for (const std::string compression : {"--rate 2", "--tolerance 0.7"}) {
      for (const std::string error : {"1e-9", "0.001", "1"}) {
        const auto run = test::run_isowave(
            fmt::format("render {} {} -i {} --fit surface --device host --size 32x24 "
                        "--max-surface-error {} -o {}",
                        quoted(voxels), compression, isovalue, error, quoted(folder_ / "p.png")));
        const std::string what = voxels.string() + " " + compression + " -i " + isovalue +
                                 " --max-surface-error " + error;
        if (run.status != 0) {
          EXPECT_THAT(run.err, HasSubstr("cannot be kept")) << what;
          continue;
        }
        EXPECT_THAT(run.out, Not(HasSubstr("warning")))
            << what << ": standard output is for results";
        const std::string all = run.out + run.err, before = "with a tolerance of ";
        EXPECT_THAT(all, Not(AnyOf(HasSubstr(" nan"), HasSubstr("-nan")))) << what;
        const std::size_t at = all.find(before);
        if (at == std::string::npos) continue;
        ++num_advised;
        const std::string tolerance =
            all.substr(at + before.size(), all.find(' ', at + before.size()) - at - before.size());
        EXPECT_GT(std::stod(tolerance), 0) << what << all;
        EXPECT_EQ(test::run_isowave(fmt::format("convert {} --tolerance {} -o {}", quoted(voxels),
                                                tolerance, quoted(path_)))
                      .status,
                  0)
            << what << all;
      }
    }
  }
  EXPECT_GT(num_advised, 3u);
}

}  // namespace
}  // namespace isowave::core
