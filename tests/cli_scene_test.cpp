// Scene files of `isowave render`: every picture's scene draws the same picture again.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "isowave/scene.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::expect_one_line_error;
using test::quoted;
using testing::HasSubstr;

constexpr const char *kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz ";

class CliScene : public testing::Test {
 protected:
  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  void render(const std::string &options) const {
    const test::ProgramResult result =
        test::run_isowave("render --device host --size 48x36 " + options);
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
  }
  std::string picture(const std::string &name) const { return test::read_file(folder_ / name); }
  void write_scene_text(const std::string &text) const {
    test::write_file(folder_ / "s.json", text);
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliScene, EveryPictureIsDrawnAgainFromItsScene) {
  for (const std::string options :
       {"-i 40", "-i 40 --color orange --background black,skin --parallel",
        "--surface 10,skin,0.3 --surface 120,bone --clip 0,1,0 --transparent",
        "--surface 10,,0.5 --clip-box ,,,,8, --no-caps",
        "-i 40 --slice z,20 --slice 1,1,0 --slice-opacity 0.5 --slice-map magma --clip x",
        "--surface 10,skin,,whole --slice y --slice-range 0,99 --clip 0,0,1",
        "-i 40 --light 1,2,0.5 --shadow 2 --light-angle 9 --bounce 3",
        "-i 40 --color-by 1,1,0,5,60 --color-map magma --samples 2",
        "-i 40 --color-by depth --view left"}) {
    render(kFuel + options + " -o " + in("a.png") + " --save-scene " + in("s.json"));
    const std::string samples = options.find("--samples") == options.npos ? "" : " --samples 2";
    render("--scene " + in("s.json") + " -o " + in("b.png") + samples);
    EXPECT_FALSE(picture("a.png").empty());
    EXPECT_EQ(picture("b.png"), picture("a.png")) << options;
    // The scene of a scene's picture is the same file.
    render("--scene " + in("s.json") + " -o " + in("b.png") + " --save-scene " + in("t.json"));
    EXPECT_EQ(picture("t.json"), picture("s.json")) << options;
  }
}

TEST_F(CliScene, AFieldIsOpenedAgain) {
  const auto made = test::run_isowave("convert " + std::string(kFuel) + "-o " + in("heat.zfp"));
  ASSERT_EQ(made.status, 0) << made.err;
  std::filesystem::create_directory(folder_ / "scenes");
  const std::string heat = "'" + (folder_ / "heat.zfp").string();
  for (const std::string &options :
       {"--color-by " + heat + "'", "--color-by " + heat + ",0,300' --color-map magma",
        std::string("--color-by volume,0,90 --clip 1,0,0,-30")}) {
    render(kFuel + std::string("-i 40 -o ") + in("a.png") + " --save-scene " + in("scenes/s.json") +
           " " + options);
    render("--scene " + in("scenes/s.json") + " -o " + in("b.png") + " --save-scene " +
           in("scenes/t.json"));
    EXPECT_EQ(picture("b.png"), picture("a.png")) << options;
    EXPECT_EQ(picture("scenes/t.json"), picture("scenes/s.json")) << options;
    EXPECT_THAT(picture("scenes/s.json"), HasSubstr("\"color_by_field\": true"));
  }
  EXPECT_THAT(picture("scenes/s.json"), HasSubstr("\"field\": \"volume\""));
  render(kFuel + std::string("-i 40 --rate 8 -o ") + in("b.png") + " --color-by " + heat + "'");
  // A field that colours nothing is not opened, and stays.
  write_scene_text(
      R"({"isowave_scene": 1, "field": "absent.nrrd", "surfaces": [{"isovalue": 40}]})");
  render(kFuel + std::string("--scene ") + in("s.json") + " -o " + in("b.png") + " --save-scene " +
         in("t.json"));
  EXPECT_THAT(picture("t.json"), HasSubstr("absent.nrrd\""));
}

TEST_F(CliScene, OptionsNameAnotherVolumeAndOtherCameras) {
  write_scene_text(R"({"isowave_scene": 1, "volume": "absent.nrrd",
                       "surfaces": [{"isovalue": 40, "color": "#DBBD87"}]})");
  render(kFuel + std::string("-i 40 -o ") + in("a.png"));
  render(kFuel + std::string("--scene ") + in("s.json") + " -o " + in("b.png"));
  EXPECT_EQ(picture("b.png"), picture("a.png")) << "the default view";
  render(kFuel + std::string("-i 40 --orbit 2 -o ") + in("a.png"));
  render(kFuel + std::string("--scene ") + in("s.json") + " --orbit 2 -o " + in("b.png"));
  EXPECT_EQ(picture("b_view1.png"), picture("a_view1.png"));
  // The scene's camera gives way to others.
  render(kFuel + std::string("-i 40 -o ") + in("c.png") + " --save-scene " + in("s.json"));
  render("--scene " + in("s.json") + " --orbit 2 -o " + in("b.png"));
  EXPECT_EQ(picture("b_view1.png"), picture("a_view1.png"));
}

TEST_F(CliScene, DepthFollowsTheView) {
  render(kFuel + std::string("-i 40 --color-by depth --view left -o ") + in("a.png") +
         " --save-scene " + in("s.json"));
  render(kFuel + std::string("-i 40 --color-by depth --view top -o ") + in("a.png"));
  render("--scene " + in("s.json") + " --view top -o " + in("b.png"));
  EXPECT_EQ(picture("b.png"), picture("a.png"));
}

TEST_F(CliScene, KeepsTheIndexOfItsFiles) {
  std::string voxels = "NRRD0004\ntype: uint8\nencoding: raw\ndimension: 4\nsizes: 8 8 8 3\n\n";
  for (int step = 0; step < 3; ++step)
    for (int i = 0; i < 512; ++i)
      voxels += static_cast<char>(i % 8 * 20 + (i / 8 % 8) * step * 5 + i / 64);
  test::write_file(folder_ / "four.nrrd", voxels);
  const auto drawn = [&](const std::string &options) {
    render(options + " -o " + in("a.png"));
    return picture("a.png");
  };
  const std::string four = in("four.nrrd"), scene = "--scene " + in("s.json");
  const std::string by = " --color-by '" + (folder_ / "four.nrrd").string() + "'";
  const std::string first =
      drawn(four + " -i 70 --index t=1" + by + " --field-index t=2 --save-scene " + in("s.json"));
  EXPECT_THAT(picture("s.json"), HasSubstr("\"index\": \"t=1\""));
  EXPECT_THAT(picture("s.json"), HasSubstr("\"field_index\": \"t=2\""));
  EXPECT_EQ(drawn(scene + " --save-scene " + in("t.json")), first);
  EXPECT_EQ(picture("t.json"), picture("s.json"));
  // Options choose others. The index is of the scene's file, not of another one.
  const std::string camera = " --cameras " + in("c.json");
  drawn(four + " -i 70 --index t=1 --save-camera " + in("c.json"));
  EXPECT_EQ(drawn(scene + " --index t=0"),
            drawn(four + " -i 70 --index t=0" + by + " --field-index t=2" + camera));
  EXPECT_EQ(drawn(scene + " --field-index t=0"),
            drawn(four + " -i 70 --index t=1" + by + " --field-index t=0" + camera));
  EXPECT_NE(drawn(scene + " --field-index t=0"), first);
  EXPECT_NE(drawn(scene + " --index t=0"), first);
  const std::string alone =
      R"({"isowave_scene": 1, "surfaces": [{"isovalue": 40}], "volume": "a.nrrd", "index": "t=1")";
  write_scene_text(alone + "}");
  drawn(kFuel + scene);
  write_scene_text(alone + R"(, "dataset": "ct"})");
  drawn(kFuel + scene);
  expect_one_line_error("render --device host " + scene,
                        "s.json: dataset ct: isowave's Python package");
  write_scene_text(R"({"isowave_scene": 1, "surfaces": [{"isovalue": 40}], "volume": "a.nrrd",)"
                   R"( "index": "c=1"})");
  expect_one_line_error("render --device host " + scene, "s.json: index c=1: give t=N");
  expect_one_line_error(
      "render --device host " + std::string(kFuel) + "-i 40 --color-by volume --field-index t=1",
      "--field-index: no file's values");
}

TEST_F(CliScene, BadScenesAreOneLine) {
  const auto refuse = [&](const std::string &options, std::string_view text) {
    expect_one_line_error("render --device host " + options, text);
  };
  write_scene_text(R"({"isowave_scene": 1, "surfaces": [{"isovalue": 40}]})");
  const std::string scene = "--scene " + in("s.json") + " ";
  refuse(scene, "VOLUME is required");
  refuse("--scene absent.json", "absent.json");
  for (const std::string option :
       {"--isovalue 3", "--surface 3", "--color red", "--color-by z", "--background red",
        "--transparent", "--clip 1,0,0", "--clip-box 1,,,,,", "--no-caps", "--slice z"}) {
    refuse(kFuel + scene + option, "--scene says what is drawn: leave out either");
  }
  refuse(kFuel + scene + "--save-scene " + in("s.json"), "the input");
  refuse(kFuel + std::string("-i 3 --save-scene ") + in("s.png"), "s.png");
  refuse(kFuel + std::string("-i 3 -i 4 --save-scene ") + in("t.json"), "a scene is one picture");
  refuse(kFuel + std::string("-i 3 --orbit 2 --save-scene ") + in("t.json"),
         "a scene is one picture");
  write_scene_text(R"({"isowave_scene": 1, "surfaces": [{"isovalue": 40, "opacity": 0}]})");
  refuse(kFuel + scene, "s.json: an opacity of 0 is out of range");
  write_scene_text(R"({"isowave_scene": 1, "color_map": "jet", "surfaces": [{"isovalue": 40}]})");
  refuse(kFuel + scene, "jet");
  const std::string by_field =
      R"({"isowave_scene": 1, "surfaces": [{"isovalue": 40}], "color_map": "gray",)"
      R"( "color_by_field": true)";
  write_scene_text(by_field + "}");
  refuse(kFuel + scene, "s.json: its colours are by a field, and it names none");
  write_scene_text(by_field + R"(, "field": "absent.nrrd"})");
  refuse(kFuel + scene, "absent.nrrd: no such file");
  write_scene_text(by_field + R"(, "field": "volume"})");
  refuse(kFuel + scene + "--time-budget 9", "--time-budget");
  test::write_file(folder_ / "heat.npy", "no volume");
  write_scene_text(by_field + R"(, "field": "heat.npy"})");
  refuse(kFuel + scene + "--depth " + in("heat.npy"), "the input");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "t.json"));
}

}  // namespace
}  // namespace isowave::core
