// Isovalues that the program suggests: `info` shows them, `render` and `extract` take the first.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::ProgramResult;
using test::quoted;
using test::read_file;
using test::run_command;
using test::run_isowave;
using test::TemporaryFolder;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

const std::string kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz",
                  kHead = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";

json info_of(const std::string &arguments) {
  const ProgramResult result = run_isowave("info --json " + arguments);
  EXPECT_EQ(result.status, 0) << result.err;
  return json::parse(result.out);
}

class CliSuggestions : public testing::Test {
 protected:
  std::string path(const std::string &name) const { return quoted(folder_ / name); }
  /// Runs the program in the folder.
  ProgramResult run(const std::string &arguments) const {
    return run_command("cd " + path("") + " && " + test::isowave_program() + " " + arguments);
  }

  TemporaryFolder folder_;
};

TEST_F(CliSuggestions, AreThoseOfTheSameVolumeInAnyFile) {
  for (const std::string &volume :
       {kFuel, kHead, std::string("generate:gyroid_40x40x40_float64")}) {
    ASSERT_EQ(run("convert " + volume + " -o a.zfp").status, 0);
    const json raw = info_of(volume), zfp = info_of(path("a.zfp"));
    EXPECT_FALSE(raw["suggested_isovalues"].empty()) << volume;
    EXPECT_EQ(raw["suggested_isovalues"], zfp["suggested_isovalues"]) << volume;
    EXPECT_EQ(raw["histogram"], zfp["histogram"]) << volume;
    EXPECT_EQ(raw["suggested_isovalues"][0]["by"], "Otsu's threshold");
  }
  const json fuel = info_of(kFuel);
  EXPECT_EQ(fuel["histogram"]["range"], (std::array{0, 255}));
  const std::vector<std::uint64_t> counts = fuel["histogram"]["counts"];
  EXPECT_EQ(counts.size(), 256u);
  std::uint64_t count = 0;
  for (const std::uint64_t bin : counts) count += bin;
  EXPECT_EQ(count, 64u * 33 * 32);
  EXPECT_FALSE(info_of("--no-scan " + kFuel).contains("suggested_isovalues"));
}

TEST_F(CliSuggestions, VoxelsWithoutDataAreNotCounted) {
  const json all = info_of(kFuel), some = info_of("--no-data 0 " + kFuel);
  const std::vector<std::uint64_t> counts = some["histogram"]["counts"];
  const std::uint64_t zeros = all["histogram"]["counts"][0];
  EXPECT_GT(zeros, 1000u);
  EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), zeros), 64u * 33 * 32);
  EXPECT_EQ(some["histogram"]["range"][0], 1);
}

TEST_F(CliSuggestions, TheHistogramIsText) {
  const std::string plain =
                        run_command("LC_ALL=C " + test::isowave_program() + " info " + kFuel).out,
                    blocks = run_command("LC_ALL= LC_CTYPE= LANG=C.UTF-8 " +
                                         test::isowave_program() + " info " + kFuel)
                                 .out;
  EXPECT_THAT(plain, ContainsRegex("isovalues +[0-9.]+ \\(Otsu's threshold\\)"));
  EXPECT_TRUE(std::ranges::all_of(plain, [](char c) {
    return c == '\n' || (c >= ' ' && c <= '~');
  })) << plain;
  EXPECT_THAT(blocks, HasSubstr("█"));
  // The last lines: 8 rows, the axis with the place of the first isovalue, and the range.
  const auto axis = plain.rfind("\n-");
  ASSERT_NE(axis, std::string::npos) << plain;
  const std::string line = plain.substr(axis + 1, 64);
  const double isovalue = info_of(kFuel)["suggested_isovalues"][0]["isovalue"];
  EXPECT_EQ(line.find('1'), static_cast<std::size_t>(isovalue / 255 * 64)) << line;
  const auto begin = plain.find('\n', plain.find("isovalues")) + 1;
  EXPECT_EQ(std::count(plain.begin() + static_cast<std::ptrdiff_t>(begin), plain.end(), '\n'), 10);
  EXPECT_EQ(plain[begin], '#') << "most voxels of fuel have the least value";
  EXPECT_THAT(plain.substr(axis + 66), testing::MatchesRegex("0 +255\n"));
}

TEST_F(CliSuggestions, RenderTakesTheFirst) {
  const double first = info_of(kFuel)["suggested_isovalues"][0]["isovalue"];
  const std::string size = " --size 48x36 ";
  const ProgramResult suggested = run("render " + kFuel + size);
  ASSERT_EQ(suggested.status, 0) << suggested.err;
  EXPECT_THAT(suggested.out,
              HasSubstr(fmt::format("isovalue {} is suggested (Otsu's threshold); choose another "
                                    "with --isovalue\n",
                                    first)));
  const std::string name = fmt::format("fuel_64x33x32_uint8_iso{}.png", first);
  EXPECT_THAT(suggested.out, HasSubstr("wrote " + name));
  const ProgramResult given =
      run(fmt::format("render {}{}-i {} -o given.png --stats given.json", kFuel, size, first));
  EXPECT_THAT(given.out, Not(HasSubstr("suggested")));
  EXPECT_EQ(read_file(folder_ / name), read_file(folder_ / "given.png"));
  EXPECT_EQ(json::parse(read_file(folder_ / "given.json"))["options"]["isovalue_suggested"], false);
  EXPECT_EQ(run("render " + kFuel + size + "--orbit 2 -o x.png --stats x.json").status, 0);
  const json stats = json::parse(read_file(folder_ / "x.json"));
  EXPECT_EQ(stats["options"]["isovalue_suggested"], true);
  EXPECT_EQ(stats["frames"][1]["isovalue"], first);
  EXPECT_TRUE(exists(folder_ / fmt::format("x_iso{}_view1.png", first)));
}

TEST_F(CliSuggestions, TheTwinAndTheHostDrawThem) {
  for (const char *by : {" --reference", " --device host"}) {
    const ProgramResult result = run("render " + kHead + by + " --size 16x12 -o a.png");
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr(" is suggested (Otsu's threshold)"));
  }
}

TEST_F(CliSuggestions, ExtractTakesTheFirst) {
  const double first = info_of(kFuel)["suggested_isovalues"][0]["isovalue"];
  const ProgramResult suggested = run("extract " + kFuel + " --stats a.json");
  ASSERT_EQ(suggested.status, 0) << suggested.err;
  EXPECT_THAT(suggested.out, HasSubstr(fmt::format("isovalue {} is suggested (Otsu", first)));
  EXPECT_EQ(run(fmt::format("extract {} -i {} -o given.ply --stats b.json", kFuel, first)).status,
            0);
  EXPECT_EQ(read_file(folder_ / fmt::format("fuel_64x33x32_uint8_iso{}.ply", first)),
            read_file(folder_ / "given.ply"));
  EXPECT_EQ(json::parse(read_file(folder_ / "a.json"))["isovalue_suggested"], true);
  EXPECT_EQ(json::parse(read_file(folder_ / "b.json"))["isovalue_suggested"], false);
}

TEST_F(CliSuggestions, OneValueAsksForAnIsovalue) {
  const std::string volume = path("a_4x4x4_uint8.raw");
  test::write_file(folder_ / "a_4x4x4_uint8.raw", std::string(64, '\7'));
  for (const char *command : {"render ", "extract "}) {
    for (const auto &[options, text] :
         {std::pair("", "all voxels have the value 7"), {" --no-data 7", "no voxel has data"}}) {
      const ProgramResult result = run(command + volume + options);
      EXPECT_EQ(result.status, 1) << command;
      EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
      EXPECT_THAT(result.err, HasSubstr(std::string(text) +
                                        ", so no isovalue can be suggested: give --isovalue"));
    }
  }
  EXPECT_EQ(folder_.num_files(), 1u) << "something was left behind";
  EXPECT_THAT(run("info " + volume).out, Not(HasSubstr("isovalues")));
  EXPECT_FALSE(info_of(volume).contains("suggested_isovalues"));
}

// Outputs are looked at before the volume is read, though their names are not known yet.
TEST_F(CliSuggestions, OutputsAreCheckedFirst) {
  const std::string volume = "render " + path("missing_4x4x4_uint8.raw");
  expect_one_line_error(volume + " -o " + path("none/a.png"), "none");
  expect_one_line_error(volume + " -o " + path("a.jpg"), "a.jpg");
  expect_one_line_error(volume + " --orbit 2 -o " + path("none/a.png"), "none");
}

}  // namespace
}  // namespace isowave::core
