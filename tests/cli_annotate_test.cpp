// `isowave render --annotate`: pictures change where the layout says, and nothing else does.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/io/png.hpp"
#include "isowave/annotations.hpp"
#include "isowave/scene.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string kFuel = "render " ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz --device host ";

class CliAnnotate : public testing::Test {
 protected:
  void SetUp() override {
    const test::ProgramResult result =
        test::run_isowave(kFuel + "-i 40 --size 200x150 --annotate axes -o " + in("a.png"));
    if (result.err.find("built without Cairo") != result.err.npos) GTEST_SKIP() << result.err;
    ASSERT_EQ(result.status, 0) << result.err;
  }
  std::string in(const char *name) const { return test::quoted(folder_ / name); }
  void render(const std::string &options) const {
    const test::ProgramResult result = test::run_isowave(kFuel + options);
    ASSERT_EQ(result.status, 0) << options << "\n" << result.err;
  }
  void expect_refused(const std::string &options, const std::string &why) const {
    const test::ProgramResult result = test::run_isowave(kFuel + options);
    EXPECT_EQ(result.status, 1) << options;
    EXPECT_THAT(result.err, HasSubstr(why));
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
  }

  test::TemporaryFolder folder_;
};

/// The numbers of pixels that annotations change in each group; fails if any other changes.
std::vector<std::size_t> changes(const Image8 &plain, const Image8 &annotated,
                                 const std::vector<isowave::AnnotationGroup> &groups) {
  std::vector<std::size_t> counts(groups.size());
  for (std::size_t pixel = 0; pixel < plain.pixels.size() / plain.channels; ++pixel) {
    const auto *a = &plain.pixels[pixel * plain.channels];
    const auto *b = &annotated.pixels[pixel * plain.channels];
    if (std::equal(a, a + plain.channels, b)) continue;
    const std::size_t x = pixel % plain.width, y = pixel / plain.width;
    bool is_known = false;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      const auto &[begin, end] = std::pair(groups[i].begin, groups[i].end);
      const bool is_in = x >= begin[0] && x < end[0] && y >= begin[1] && y < end[1];
      counts[i] += is_in;
      is_known |= is_in;
    }
    EXPECT_TRUE(is_known) << "pixel " << x << ", " << y;
  }
  return counts;
}

TEST_F(CliAnnotate, PicturesChangeInTheGroupsAlone) {
  for (const std::string options :
       {"-i 40 --parallel", "-i 40 --color-by z --samples 2 --background black,'#405080'",
        "--surface 10,skin,0.4 --surface 120,bone --orbit 1",
        "-i 40 --transparent --color-by x,0,10", "-i 40 --slice z --slice-range 0,1",
        "-i 40 --slice z --slice-range 0,1 --color-by x,0,1"}) {
    const std::string frame = options + " --size 320x240 ";
    render(frame + "--depth " + in("a.npy") + " --save-scene " + in("s.json") + " -o " +
           in("a.png"));
    render(frame + "--depth " + in("b.npy") + " --annotate all --units nm -o " + in("b.png"));
    EXPECT_EQ(test::read_file(folder_ / "a.npy"), test::read_file(folder_ / "b.npy"));
    isowave::FrameRequest request = scene_request(isowave::read_scene(folder_ / "s.json"));
    request.size = {320, 240, 1};
    const bool has_map = !request.appearance.color_map.empty();
    const bool has_slices = !request.slices.empty();
    const std::optional<std::array<double, 2>> range = std::array{0.0, 1.0};
    const std::vector<isowave::AnnotationGroup> groups = annotation_layout(
        {true, true, has_map || has_slices, true, "nm", "fuel_64x33x32_uint8.raw.gz"}, request,
        has_map ? range : std::nullopt, has_slices ? range : std::nullopt);
    EXPECT_EQ(groups.size(), 3u + (has_map ? 1 : 0) + (has_slices ? 1 : 0));
    const Image8 plain = read_png(folder_ / "a.png"), annotated = read_png(folder_ / "b.png");
    ASSERT_EQ(annotated.channels, plain.channels);
    for (const std::size_t count : changes(plain, annotated, groups))
      EXPECT_GT(count, 100u) << options;
    // The middle of the scale bar has its colour, and is opaque.
    const isowave::AnnotationStroke &bar = groups[0].strokes[0];
    const auto x = static_cast<std::size_t>((bar.points[1][0] + bar.points[2][0]) / 2),
               y = static_cast<std::size_t>(bar.points[1][1] - 0.5);
    const std::uint8_t *pixel = &annotated.pixels[(y * 320 + x) * annotated.channels];
    for (std::size_t channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(pixel[channel], 255 * bar.color[channel], 130) << options;
    if (plain.channels == 4) {
      EXPECT_EQ(pixel[3], 255);
    }
  }
}

TEST_F(CliAnnotate, NamesChooseWhatIsDrawn) {
  const std::string frame = "-i 40 --size 320x240 --color-by z -o ";
  render(frame + in("plain.png"));
  const Image8 plain = read_png(folder_ / "plain.png");
  const auto count = [&](const std::string &names) {
    render(frame + in("b.png") + " --annotate " + names);
    const Image8 picture = read_png(folder_ / "b.png");
    std::size_t differing = 0;
    for (std::size_t i = 0; i < plain.pixels.size(); ++i)
      differing += plain.pixels[i] != picture.pixels[i];
    return differing;
  };
  const std::size_t bar = count("scale-bar"), axes = count("axes"), colors = count("color-bar"),
                    caption = count("caption");
  for (const std::size_t each : {bar, axes, colors, caption}) EXPECT_GT(each, 300u);
  EXPECT_EQ(count("axes,scale-bar"), axes + bar);
  EXPECT_EQ(count("all"), bar + axes + colors + caption);
}

TEST_F(CliAnnotate, RefinedPicturesAreAnnotated) {
  const std::string frame = "-i 40 --size 320x240 --annotate all ";
  render(frame + "-o " + in("a.png"));
  render(frame + "--time-budget 1000000 -o " + in("b.png") + " --refined " + in("c.png"));
  for (const char *name : {"b.png", "c.png"})
    EXPECT_EQ(test::read_file(folder_ / name), test::read_file(folder_ / "a.png")) << name;
}

TEST_F(CliAnnotate, ScenesKeepThem) {
  const std::string size = "--size 320x240 ", frame = "-i 40 --color-by z " + size;
  const std::string scene = size + "--scene " + in("s.json") + " ";
  render(frame + "--annotate all --units µm -o " + in("a.png") + " --save-scene " + in("s.json"));
  EXPECT_THAT(test::read_file(folder_ / "s.json"), Not(HasSubstr("title"))) << "the file's name is";
  const auto expect_same = [&](const std::string &of_scene, const std::string &of_options) {
    render(scene + of_scene + " -o " + in("b.png"));
    render(frame + of_options + " -o " + in("c.png"));
    EXPECT_EQ(test::read_file(folder_ / "b.png"), test::read_file(folder_ / "c.png")) << of_scene;
  };
  expect_same("", "--annotate all --units µm");
  // Options change what the scene has.
  expect_same("--units mm", "--annotate all --units mm");
  expect_same("--annotate scale-bar,axes", "--annotate scale-bar,axes --units µm");
  expect_same("--annotate caption --units km", "--annotate caption --units km");
  expect_same("--annotate none", "");
  expect_same("--time-budget 1000000 --refined " + in("r.png"), "--annotate all --units µm");
  EXPECT_EQ(test::read_file(folder_ / "r.png"), test::read_file(folder_ / "a.png"));
  // The scene of a scene's picture has what was drawn.
  render(scene + "-o " + in("b.png") + " --save-scene " + in("t.json"));
  EXPECT_EQ(test::read_file(folder_ / "t.json"), test::read_file(folder_ / "s.json"));
  render(scene + "--annotate none -o " + in("b.png") + " --save-scene " + in("t.json"));
  EXPECT_FALSE(isowave::read_scene(folder_ / "t.json").annotations);
  // Without a picture, any size will do, and the saved scene keeps them.
  render("--size 20x10 --scene " + in("s.json") + " --depth " + in("d.npy") + " --save-scene " +
         in("t.json"));
  EXPECT_TRUE(isowave::read_scene(folder_ / "t.json").annotations);
  // A title comes in the place of the file's name, and options leave it.
  isowave::Scene titled = isowave::read_scene(folder_ / "s.json");
  titled.annotations->title = "another fuel";
  write_scene(titled, folder_ / "s.json");
  render(scene + "--annotate caption -o " + in("d.png"));
  render(frame + "--annotate caption -o " + in("c.png"));
  EXPECT_NE(test::read_file(folder_ / "d.png"), test::read_file(folder_ / "c.png"));
  render(frame + "--annotate caption --title '" + titled.annotations->title + "' -o " +
         in("e.png"));
  EXPECT_EQ(test::read_file(folder_ / "e.png"), test::read_file(folder_ / "d.png"));
}

TEST_F(CliAnnotate, WhatCannotBeIsRefusedInOneLine) {
  const std::string frame = "-i 40 --size 320x240 -o " + in("n.png");
  expect_refused(frame + " --annotate axis",
                 "--annotate axis: there are scale-bar, axes, color-bar, caption, and all");
  expect_refused(frame + " --annotate axes,", "--annotate : there are");
  expect_refused(frame + " --annotate color-bar", "give --color-by");
  expect_refused(frame + " --annotate axes,none", "--annotate none: there are");
  expect_refused(frame + " --units mm", "--units mm: nothing is annotated: give --annotate");
  expect_refused(frame + " --annotate none --units mm", "--units mm: nothing is annotated");
  expect_refused(frame + " --title head", "--title head: nothing is annotated: give --annotate");
  expect_refused(frame + " --annotate all --units 12345678901234567",
                 "--units 12345678901234567: give at most 16 letters");
  expect_refused("-i 40 --size 199x150 --annotate all -o " + in("n.png"),
                 "199 x 150 pixels are too few for annotations");
  expect_refused("-i 40 --annotate all --depth " + in("d.npy"),
                 "--annotate: no picture is annotated: give --output");
  test::write_file(folder_ / "s.json", R"({"isowave_scene": 1, "surfaces": [{"isovalue": 40}],)"
                                       R"( "annotations": {"axes": true}})");
  expect_refused("--size 199x150 --scene " + in("s.json") + " -o " + in("n.png"),
                 "199 x 150 pixels are too few for annotations");
  expect_refused("--units mm --scene " + in("s.json") + " --depth " + in("d.npy"),
                 "--units: no picture is annotated: give --output");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "n.png"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "d.npy"));
}

}  // namespace
}  // namespace isowave::core
