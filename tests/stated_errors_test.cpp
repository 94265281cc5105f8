// Files whose checksums are right and whose trailers contradict their voxels: what can be told from
// the blocks is refused in one line, and what rests on the file's word says so.

#include "core/zfp/stated_errors.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/bricks/brick_volume.hpp"
#include "core/sources/load_volume.hpp"
#include "core/volume/pyramid.hpp"
#include "core/zfp/cut_blocks.hpp"
#include "core/zfp/level_bounds.hpp"
#include "core/zfp/zfp_file.hpp"
#include "isowave/isowave.hpp"
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
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A volume with levels of detail and bounds.
CompressedVolume make_volume(const std::string &name, const Storage &storage) {
  return compress_volume([&] { return open_any_volume(name, {}); }, name, storage);
}

class StatedErrors : public testing::Test {
 protected:
  static constexpr const char *kName = "generate:gyroid_30x19x24_float32";

  /// Writes a file, of which `lie` has changed something, with right checksums.
  void write(const std::function<void(CompressedVolume &)> &lie,
             const Storage &storage = {.rate = 8, .levels = 0, .measure_error = true}) {
    CompressedVolume volume = make_volume(kName, storage);
    range_ = volume.value_range;
    lie(volume);
    write_zfp_file(volume, path_);
  }
  void write_honest() {
    write([](CompressedVolume &) {});
  }
  /// Writes the file again with another value in its trailer.
  void change(const std::string &key, const json &value) {
    const TrailerFile parts(test::read_file(path_));
    json trailer = json::parse(parts.text);
    trailer[key] = value;
    test::write_file(path_, with_trailer(parts.before, trailer.dump(), parts.version));
  }
  /// The same in the trailer of its first coarser level.
  void change_level(const std::function<void(json &)> &lie) {
    const TrailerFile parts(test::read_file(path_));
    json trailer = json::parse(parts.text);
    std::size_t all = 0;
    for (const json &bytes : trailer["level_bytes"]) all += bytes.get<std::size_t>();
    const std::size_t begin = parts.before.size() - all,
                      size = trailer["level_bytes"][0].get<std::size_t>();
    const TrailerFile level(parts.before.substr(begin, size));
    json of_level = json::parse(level.text);
    lie(of_level);
    const std::string changed = with_trailer(level.before, of_level.dump(), level.version);
    trailer["level_bytes"][0] = changed.size();
    test::write_file(path_, with_trailer(parts.before.substr(0, begin) + changed +
                                             parts.before.substr(begin + size),
                                         trailer.dump(), parts.version));
  }
  std::string refusal() const {
    try {
      check_stated_errors(open_zfp_file(path_), {});
    } catch (const Error &error) {
      return error.what();
    }
    return "none";
  }
  std::string render(const std::string &options) const {
    return "render " + quoted(path_) + " -i 0.5 --device cpu --size 24x16 " + options;
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_ / "a.zfp";
  std::array<float, 2> range_{};  ///< of the volume that was written last
};

// ---- files that are right

TEST_F(StatedErrors, HonestFilesAreAccepted) {
  using std::nullopt;
  for (const std::string name :
       {"gyroid_18x17x19_float32", "gyroid_33x16x24_uint8", "turbulence_30x19x21_float64",
        "noisy_scan_16x17x18_int32", "gyroid_16x32x23_uint16", "scan_22x9x40_int8"}) {
    for (const Storage &storage :
         {Storage{.rate = 1, .levels = 0, .measure_error = true},
          Storage{.rate = 6, .levels = 0, .measure_error = true},
          Storage{.rate = 32, .levels = 0, .measure_error = true}, Storage{.rate = 2, .levels = 0},
          Storage{.tolerance_relative = 0.1, .levels = 0},
          Storage{.tolerance_relative = 1e-5, .levels = 0}}) {
      const CompressedVolume volume = make_volume("generate:" + name, storage);
      EXPECT_FALSE(volume.errors_are_stated);
      write_zfp_file(volume, path_);
      EXPECT_EQ(refusal(), "none") << name << " " << storage.rate.value_or(0);
    }
  }
  write_zfp_file(make_volume("generate:gyroid_33x16x24_uint8", {.exact = true, .levels = 0}),
                 path_);
  EXPECT_EQ(refusal(), "none");
  EXPECT_TRUE(open_zfp_file(path_).errors_are_stated);
}

// ---- what the trailer alone contradicts

TEST_F(StatedErrors, ValuesAreOnesThatTheTypeHas) {
  write_honest();
  const std::string honest = test::read_file(path_);
  const auto opens = [&](const char *type, const json &range) {
    test::write_file(path_, honest);
    change("type", type);
    change("value_range", range);
    change("cast_counts", true);
    try {
      open_zfp_file(path_);
      return true;
    } catch (const Error &error) {
      EXPECT_THAT(error.what(), HasSubstr("is no value of type " + std::string(type)));
      EXPECT_THROW(read_zfp_file_info(path_), Error);
      EXPECT_THROW(isowave::open_volume(path_), isowave::Error);
      return false;
    }
  };
  EXPECT_TRUE(opens("uint8", {0, 255}));
  EXPECT_FALSE(opens("uint8", {-1, 255}));
  EXPECT_FALSE(opens("uint8", {0, 1e5}));
  EXPECT_FALSE(opens("uint8", {0.5, 3}));
  EXPECT_TRUE(opens("int16", {-32768, 32767}));
  EXPECT_FALSE(opens("int16", {-32769, 0}));
  EXPECT_TRUE(opens("uint32", {0, 4294967295.0}));
  EXPECT_FALSE(opens("uint32", {0, 5e9}));
  EXPECT_TRUE(opens("int32", {-2147483648.0, 2147483647.0}));
  EXPECT_FALSE(opens("int32", {0, 0.25}));
  EXPECT_TRUE(opens("float32", {-1e37, 1e37}));
  EXPECT_FALSE(opens("float32", {0, 1e38}));
  EXPECT_FALSE(opens("float64", {-1e38, 0}));
}

TEST_F(StatedErrors, ErrorsAreThoseOfFloats) {
  for (const double error : {-1e-300, 1e39, 1e300}) {
    write_honest();
    change("max_error", error);
    EXPECT_THAT([&] { open_zfp_file(path_); }, ThrowsMessage<Error>(HasSubstr("is no error")));
  }
}

/// A block's bound holds for all its voxels, and is no larger than they need.
TEST_F(StatedErrors, BoundsOfBlocksAreThoseOfTheLargestError) {
  for (const double factor : {0.0, 0.25, 2.0, 100.0}) {
    write([&](CompressedVolume &volume) { *volume.max_voxel_error *= factor; });
    const auto refused = ThrowsMessage<Error>(
        HasSubstr(factor < 1 ? "no voxel is off by more than" : "no block by more than"));
    EXPECT_THAT([&] { open_zfp_file(path_); }, refused);
    EXPECT_THAT([&] { check_zfp_file(path_); }, refused);
    EXPECT_THAT([&] { read_brick(path_, {{0, 0, 0}, {2, 2, 2}}, 1, true); }, refused);
  }
}

TEST_F(StatedErrors, OnlyIntegersAreWholeNumbers) {
  const Storage bounded{.tolerance = 0.01, .levels = 0};
  write([](CompressedVolume &volume) { volume.precision.whole_numbers = true; }, bounded);
  EXPECT_THAT([&] { open_zfp_file(path_); }, ThrowsMessage<Error>(HasSubstr("no whole numbers")));
  write([](CompressedVolume &) {}, bounded);
  change_level([](json &level) {
    level["whole_numbers"] = true;
    level["type"] = "uint8";
    level.erase("value_range");
  });
  EXPECT_THAT([&] { open_zfp_file(path_); },
              ThrowsMessage<Error>(HasSubstr("one of its levels of detail is none")));
}

TEST_F(StatedErrors, FilesWithErrorsAreNotExact) {
  write(
      [](CompressedVolume &volume) {
        volume.info.type = VoxelType::kUint8;
        volume.value_range = {0, 1};
        volume.precision.whole_numbers = true;
      },
      {.tolerance = 0.5});
  const json info = json::parse(test::run_isowave("info --no-scan --json " + quoted(path_)).out);
  EXPECT_EQ(info["exact"], false);
}

/// A level lies where the finest level's grid says.
TEST_F(StatedErrors, GridsOfLevelsAreDerived) {
  write_honest();
  const CompressedVolume honest = open_zfp_file(path_);
  change_level([](json &level) {
    level["spacing"] = {3, 5e-300, 1e30};
    level["origin"] = {1, 2, 3};
    level["direction"] = {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}};
    level["type"] = "int8";
    level["value_range"] = {-3, 3};
  });
  for (const CompressedVolume &read : {open_zfp_file(path_), read_zfp_file_info(path_)}) {
    const VolumeInfo &got = read.coarser_levels.at(0).info,
                     &expected = honest.coarser_levels.at(0).info;
    EXPECT_EQ(got.spacing, expected.spacing);
    EXPECT_EQ(got.origin, expected.origin);
    EXPECT_EQ(got.direction, expected.direction);
    EXPECT_EQ(got.type, VoxelType::kFloat32);
    EXPECT_EQ(read.coarser_levels.at(0).value_range, kUnknownRange);
  }
}

// ---- what the blocks contradict

/// Refused before a bound is drawn, and by `info`; frames without bounds do not need the range.
TEST_F(StatedErrors, RangesThatBlocksLeaveAreRefused) {
  for (const bool low : {false, true}) {
    write([&](CompressedVolume &volume) {
      const float part = 0.125f * (volume.value_range[1] - volume.value_range[0]);
      volume.value_range[low ? 0 : 1] += low ? part : -part;
    });
    EXPECT_THAT(refusal(), HasSubstr("its trailer says that values are "));
    EXPECT_THAT(refusal(), HasSubstr("a.zfp"));
    test::expect_one_line_error("info " + quoted(path_), "its trailer says that values are ");
    EXPECT_EQ(test::run_isowave("info --no-scan " + quoted(path_)).status, 0);
    const auto refused =
        test::run_isowave(render("--max-surface-error 1 --error-map " + quoted(folder_ / "e.npy")));
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.err, HasSubstr("its trailer says that values are "));
    EXPECT_FALSE(fs::exists(folder_ / "e.npy"));
    const auto meshed = test::run_isowave("extract " + quoted(path_) + " -i 0.5 --device cpu -o " +
                                          quoted(folder_ / "m.ply"));
    EXPECT_EQ(meshed.status, 0) << meshed.err;
    const auto drawn = test::run_isowave(render("--depth " + quoted(folder_ / "lie.npy")));
    EXPECT_EQ(drawn.status, 0) << drawn.err;
    write_honest();
    test::run_isowave(render("--depth " + quoted(folder_ / "right.npy")));
    EXPECT_EQ(test::read_file(folder_ / "lie.npy"), test::read_file(folder_ / "right.npy"));
  }
}

TEST_F(StatedErrors, RangesMayBeWider) {
  write([](CompressedVolume &volume) { volume.value_range = {-1e3f, 1e3f}; });
  EXPECT_EQ(refusal(), "none");
}

TEST_F(StatedErrors, LevelsThatAreFartherOffThanTheirBoundsAreRefused) {
  // Bounds that are too small, of a level; and values of another level's field.
  write([](CompressedVolume &volume) {
    for (std::uint8_t &code : volume.coarser_levels[0].bounds.codes) code = 0;
  });
  EXPECT_THAT(refusal(), HasSubstr("of level 1 is "));
  test::expect_one_line_error("info " + quoted(path_), "off from the level before");
  write([](CompressedVolume &volume) {
    for (std::uint8_t &code : volume.coarser_levels[1].bounds.codes) code = 1;
  });
  EXPECT_THAT(refusal(), HasSubstr("of level 2 is "));
  write([](CompressedVolume &volume) {
    const BlockBounds bounds = volume.coarser_levels[0].bounds;
    CompressedVolume other =
        make_volume("generate:turbulence_30x19x24_float32", {.rate = 8, .levels = 2})
            .coarser_levels[0];
    other.bounds = bounds;
    volume.coarser_levels[0] = std::move(other);
  });
  EXPECT_THAT(refusal(), HasSubstr("of level 1 is "));
}

// ---- what rests on the file's word says so

TEST_F(StatedErrors, VolumesSayWhereTheirErrorsComeFrom) {
  write_honest();
  EXPECT_TRUE(open_zfp_file(path_).errors_are_stated);
  EXPECT_TRUE(read_zfp_file_info(path_).errors_are_stated);
  EXPECT_TRUE(read_brick(path_, {{0, 0, 0}, {2, 2, 2}}, 1, true).errors_are_stated);
  EXPECT_TRUE(cut_blocks(open_zfp_file(path_), {{0, 0, 0}, {1, 1, 1}}).errors_are_stated);
  const json info = json::parse(test::run_isowave("info --json " + quoted(path_)).out);
  EXPECT_EQ(info["errors"], "stated");

  const auto compressed = isowave::open_volume(kName, {.rate = 8, .measure_error = true});
  EXPECT_FALSE(compressed->errors_are_stated());
  compressed->save(path_);
  EXPECT_TRUE(isowave::open_volume(path_)->errors_are_stated());
}

TEST_F(StatedErrors, ReportsSayWhatTheirBoundsRestOn) {
  write_honest();
  const fs::path stats = folder_ / "s.json";
  const auto report = [&](const std::string &volume) {
    const auto run = test::run_isowave(
        "render " + volume + " -i 0.5 --device cpu --size 24x16 --max-surface-error 1 --stats " +
        quoted(stats) + " --depth " + quoted(folder_ / "d.npy"));
    EXPECT_EQ(run.status, 0) << run.err;
    return std::pair(run.out, json::parse(test::read_file(stats)));
  };
  const auto [of_file, file_stats] = report(quoted(path_));
  EXPECT_THAT(of_file, HasSubstr("if the errors are right that the file states"));
  EXPECT_EQ(file_stats["volume"]["errors"], "stated");
  EXPECT_EQ(file_stats["frames"][0]["error"]["errors"], "stated");
  const auto [of_voxels, stats_of_voxels] = report(std::string(kName) + " --rate 8 --levels all");
  EXPECT_THAT(of_voxels, testing::Not(HasSubstr("the file states")));
  EXPECT_EQ(stats_of_voxels["volume"]["errors"], "measured");
  EXPECT_EQ(stats_of_voxels["frames"][0]["error"]["errors"], "measured");
}

}  // namespace
}  // namespace isowave::core
