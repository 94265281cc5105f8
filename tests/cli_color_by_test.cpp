// `isowave render --color-by`, run as a user runs it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "core/io/png.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::expect_one_line_error;
using test::quoted;

const std::string kVolume = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";
const std::string kHead = kVolume + " -i 80 --size 48x36 ";

class CliColorBy : public testing::Test {
 protected:
  /// The bytes of a picture. The host draws it by default: it has no kernels to compile.
  std::string draw(const std::string &options, const std::string &by = "--device host") const {
    const auto path = folder_ / "a.png";
    const auto result =
        test::run_isowave("render " + kHead + options + " " + by + " -o " + quoted(path));
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
    return test::read_file(path);
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliColorBy, AxesAndMapsMakeDifferentPictures) {
  std::set<std::string> pictures{draw("")};
  const std::vector<std::string> options{
      "x", "y", "z", "1,1,0", "z,0,20", "z,20,0", "z --color-map magma", "z --color-map coolwarm"};
  for (const std::string &option : options) pictures.insert(draw("--color-by " + option));
  EXPECT_EQ(pictures.size(), 1 + options.size());
  EXPECT_EQ(draw("--color-by 0,0,3"), draw("--color-by z"));
  EXPECT_EQ(draw("--color-by z,0,40"), draw("--color-by z"));  // the volume's box
}

TEST_F(CliColorBy, DepthIsAlongTheView) {
  const std::string front = draw("--view front --color-by depth");
  EXPECT_EQ(draw("--view front --color-by 0,0,-1"), front);
  EXPECT_EQ(draw("--view right --color-by depth"), draw("--view right --color-by=-1,0,0"));
  EXPECT_NE(draw("--view front --color-by depth,-30,0"), front);
  expect_one_line_error("render " + kHead + "--color-by depth,5 --device host",
                        "--color-by depth,5");
  expect_one_line_error(
      "render " + kHead + "--color-by depth --device host --max-image-error 0.1 --orbit 2",
      "colours by depth differ from view to view");
}

TEST_F(CliColorBy, AllRenderersDrawTheSameBytes) {
  for (const std::string &more : {std::string(), std::string(" --samples 2 --clip 1,0,0.2"),
                                  std::string(" --transparent --parallel")}) {
    const std::string by = more.empty() ? "depth" : "1,0,2";
    const std::string options = "--color-by " + by + more, host = draw(options);
    EXPECT_EQ(draw(options, "--device cpu"), host) << more;
    EXPECT_EQ(draw(options, "--reference"), host) << more;
  }
}

TEST_F(CliColorBy, AFieldColoursTheSurface) {
  const std::string small = "'" + (folder_ / "field.zfp").string() + "'";
  const auto made = test::run_isowave("convert " + kVolume + " -o " + small);
  ASSERT_EQ(made.status, 0) << made.err;
  std::set<std::string> pictures{draw(""), draw("--color-by z")};
  const std::vector<std::string> options{"--color-by " + small, "--color-by " + small + ",0,300",
                                         "--color-by volume --clip=-1,0,0,-20",
                                         "--color-by volume,0,90 --clip=-1,0,0,-20"};
  for (const std::string &option : options) {
    const std::string host = draw(option);
    EXPECT_EQ(draw(option, "--device cpu"), host) << option;
    EXPECT_EQ(draw(option, "--reference"), host) << option;
    pictures.insert(host);
  }
  EXPECT_EQ(pictures.size(), 6u);
  const auto result = test::run_isowave("render " + kHead +
                                        "--color-by volume --clip=-1,0,0,-20 --device host -o " +
                                        quoted(folder_ / "a.png"));
  EXPECT_THAT(result.out, testing::HasSubstr("values of the field at the hits: "));
  EXPECT_EQ(draw("--color-by volume"), draw("")) << "there are no caps";
  EXPECT_EQ(draw("--color-by volume --color red"), draw("--color red"));
}

/// The volume's own file, by its name, is the drawn volume: its memory is taken once.
TEST_F(CliColorBy, AFieldOfTheVolumesFileTakesNoFurtherBlocks) {
  const std::filesystem::path file = folder_ / "a.zfp", copy = folder_ / "b.zfp";
  const auto made = test::run_isowave("convert " + kVolume + " -o " + quoted(file));
  ASSERT_EQ(made.status, 0) << made.err;
  std::filesystem::copy_file(file, copy);
  std::set<std::string> pictures;
  const auto peak_with = [&](const std::string &options) {
    const std::string out = quoted(folder_ / "a.png"), stats = quoted(folder_ / "s.json");
    const auto result =
        test::run_isowave("render " + quoted(file) + " -i 80 --size 48x36 " + options +
                          " --device cpu -o " + out + " --stats " + stats);
    EXPECT_EQ(result.status, 0) << result.err;
    pictures.insert(test::read_file(folder_ / "a.png"));
    const auto json = nlohmann::json::parse(test::read_file(folder_ / "s.json"));
    return json["memory"]["peak"].get<std::uint64_t>();
  };
  const std::uint64_t without = peak_with("");
  pictures.clear();
  const std::string by = "--clip=-1,0,0,-20 --color-by ";
  const std::uint64_t shared = peak_with(by + quoted(folder_ / "." / "a.zfp"));
  EXPECT_GT(peak_with(by + quoted(copy)), shared + std::filesystem::file_size(file) / 2);
  EXPECT_EQ(pictures.size(), 1u);
  EXPECT_LT(shared, without + 48 * 36 * 4 + 1000);
}

/// Also of several and translucent surfaces, which may keep their own colours, and beside slices.
TEST_F(CliColorBy, AFieldColoursSeveralSurfaces) {
  const std::string field = "'" + (folder_ / "field.zfp").string() + "'";
  const auto made = test::run_isowave("convert " + kVolume + " -o " + field);
  ASSERT_EQ(made.status, 0) << made.err;
  const std::string out = quoted(folder_ / "a.png");
  const auto draw_all = [&](const std::string &options, const std::string &size = "48x36") {
    const auto result = test::run_isowave("render " + kVolume + " --size " + size +
                                          " --surface 60," + options + " -o " + out);
    EXPECT_EQ(result.status, 0) << result.err;
    return test::read_file(folder_ / "a.png");
  };
  const std::string by = " --color-by " + field;
  std::set<std::string> pictures;
  const std::vector<std::string> all{
      "bone,0.4 --surface 90" + by, "bone,0.4,own --surface 90" + by,
      "bone,0.4,whole,own --surface 90 --clip=-1,0,0,-20" + by + ",0,300",
      "bone,0.4 --slice z,12 --slice-opacity 0.5 --color-by volume --clip=-1,0,0,-20"};
  for (const std::string &options : all) {
    const std::string host = draw_all(options + " --device host");
    EXPECT_EQ(draw_all(options + " --reference"), host) << options;
    pictures.insert(host);
  }
  EXPECT_EQ(draw_all("bone,0.4,own --surface 90,skin,1,own --device host" + by),
            draw_all("bone,0.4 --surface 90,skin --device host"));
  EXPECT_EQ(pictures.size(), 4u);
  const std::string on_host = all[0] + " --device host";
  EXPECT_NE(draw_all(on_host + " --annotate color-bar", "200x150"), draw_all(on_host, "200x150"));
}

TEST_F(CliColorBy, AnAxisStaysOneIfAFileHasItsName) {
  const std::string axis = draw("--color-by z");
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_.path());
  std::ofstream("z") << "no volume";
  EXPECT_EQ(draw("--color-by z"), axis);
  EXPECT_EQ(draw("--color-by z,0,40"), axis);
  const auto of_file = test::run_isowave("render " + kHead + "--device host --color-by ./z");
  EXPECT_EQ(of_file.status, 1);
  EXPECT_THAT(of_file.err, testing::HasSubstr("./z: unknown kind of volume"));
  std::filesystem::current_path(before);
}

TEST_F(CliColorBy, StatisticsTellOfIt) {
  draw("--color-by z,1,2 --color-map gray --stats " + quoted(folder_ / "s.json"));
  const auto options =
      nlohmann::json::parse(test::read_file(folder_ / "s.json"))["options"]["color_by"];
  EXPECT_EQ(options["axis"], "z,1,2");
  EXPECT_EQ(options["map"], "gray");
}

TEST_F(CliColorBy, WhatItCannotMeanIsRefused) {
  for (const char *bad : {"w", "1,2", "x,1", "x,1,2,3", "1,2,3,4", "z,a,b", "zz", ""})
    expect_one_line_error("render " + kHead + "--color-by '" + bad + "'", "--color-by");
  expect_one_line_error("render " + kHead + "--color-by 0,0,0", "direction");
  expect_one_line_error("render " + kHead + "--color-by z,3,3", "two numbers that differ");
  expect_one_line_error("render " + kHead + "--color-by z --color-map jet", "jet");
  expect_one_line_error("render " + kHead + "--color-map magma", "--color-by");
  expect_one_line_error("render " + kHead + "--color-by volume,1", "--color-by");
  expect_one_line_error("render " + kHead + "--color-by volume,1,1", "two numbers that differ");
  expect_one_line_error("render " + kHead + "--color-by missing.nrrd", "volume or a file");
  expect_one_line_error("render " + kHead + "--color-by volume --time-budget 9", "--time-budget");
  expect_one_line_error("render " + kHead + "--color-by z --color '#102030'", "--color");
}

}  // namespace
}  // namespace isowave::core
