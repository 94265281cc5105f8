// `isowave render --labels`, run as a user runs it: the picture of an isosurface of the labels'
// indicator, scene files, and what is refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::expect_one_line_error;
using test::quoted;
using testing::HasSubstr;
using testing::Not;

/// Two balls that touch, 3 and 300, in 25 x 24 x 23 voxels, and the indicators of both and of 300.
class CliLabels : public testing::Test {
 protected:
  CliLabels() {
    std::string labels, of_both, of_second;
    for (int z = 0; z < 23; ++z) {
      for (int y = 0; y < 24; ++y) {
        for (int x = 0; x < 25; ++x) {
          const auto in_ball = [&](int middle) {
            return (x - middle) * (x - middle) + (y - 12) * (y - 12) + (z - 11) * (z - 11) < 36;
          };
          const int label = in_ball(17) ? 300 : in_ball(7) ? 3 : 0;
          labels += static_cast<char>(label & 255);
          labels += static_cast<char>(label >> 8);
          of_both += static_cast<char>(label != 0);
          of_second += static_cast<char>(label == 300);
        }
      }
    }
    test::write_file(folder_ / "seg_25x24x23_uint16.raw", labels);
    test::write_file(folder_ / "both_25x24x23_uint8.raw", of_both);
    test::write_file(folder_ / "second_25x24x23_uint8.raw", of_second);
  }

  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  std::string file(const std::string &name) const { return test::read_file(folder_ / name); }
  std::string render(const std::string &options) const {
    const test::ProgramResult result =
        test::run_isowave("render " + options + " --size 48x36 --device cpu");
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
    return result.out;
  }
  void refuse(const std::string &options, std::string_view text) const {
    expect_one_line_error("render " + in("seg_25x24x23_uint16.raw") + " --size 16x12 " + options,
                          text);
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliLabels, PicturesAreThoseOfIndicators) {
  const std::string seg = in("seg_25x24x23_uint16.raw");
  const std::string text =
      render(seg + " --labels 3+300,red -o " + in("a.png") + " --stats " + in("s.json"));
  EXPECT_THAT(text, HasSubstr("labels 3+300, view 0: "));
  render(in("both_25x24x23_uint8.raw") + " --surface 0.5,red -o " + in("b.png"));
  EXPECT_EQ(file("a.png"), file("b.png"));
  const test::ProgramResult on_host = test::run_isowave(
      "render " + seg + " --labels 3+300,red --size 48x36 --device host -o " + in("b.png"));
  EXPECT_EQ(on_host.status, 0) << on_host.err;
  EXPECT_EQ(file("a.png"), file("b.png"));
  const auto stats = nlohmann::json::parse(file("s.json"));
  EXPECT_EQ(stats["options"]["surfaces"][0]["labels"], (std::vector<int>{3, 300}));
  EXPECT_FALSE(stats["options"]["surfaces"][0].contains("isovalue"));

  const std::string shared = " --clip y --samples 2 --parallel -o ";
  render(seg + " --labels 299-301,,0.4" + shared + in("a.png"));
  render(in("second_25x24x23_uint8.raw") + " --surface 0.5,,0.4" + shared + in("b.png"));
  EXPECT_EQ(file("a.png"), file("b.png"));
}

/// A surface of two labels, each in its colour; the same by device, host, and scene file.
TEST_F(CliLabels, SurfacesHaveColoursByLabel) {
  const std::string seg = in("seg_25x24x23_uint16.raw") + " --labels 3+300 ";
  render(seg + "-o " + in("plain.png"));
  render(seg + "--color-by labels -o " + in("a.png") + " --save-scene " + in("s.json"));
  EXPECT_NE(file("a.png"), file("plain.png"));
  EXPECT_THAT(file("s.json"), HasSubstr("\"color_by_label\": true"));
  render("--scene " + in("s.json") + " -o " + in("b.png"));
  EXPECT_EQ(file("a.png"), file("b.png"));
  render(seg + "--color-by labels --color-map labels -o " + in("b.png"));
  EXPECT_EQ(file("a.png"), file("b.png"));
  const test::ProgramResult on_host = test::run_isowave(
      "render " + seg + "--color-by labels --size 48x36 --device host -o " + in("b.png"));
  EXPECT_EQ(on_host.status, 0) << on_host.err;
  EXPECT_EQ(file("a.png"), file("b.png"));
  render(seg + "--color-by labels --color-map gray -o " + in("b.png"));
  EXPECT_NE(file("a.png"), file("b.png"));
  // An isosurface in the colours of a segmentation in another file.
  const std::string both = in("both_25x24x23_uint8.raw") + " -i 0.5 --color-by ";
  render(both + in("seg_25x24x23_uint16.raw") + ",labels -o " + in("c.png"));
  render(both + "labels -o " + in("d.png"));
  EXPECT_NE(file("c.png"), file("d.png"));
}

TEST_F(CliLabels, ColoursByWhatIsNoLabelAreRefused) {
  const auto refuse_whole = [&](const std::string &options, const char *why) {
    const test::ProgramResult result = test::run_isowave(
        "render generate:sphere_9x9x9_float32 -i 1 --size 16x12 --device host -o " + in("a.png") +
        " " + options);
    EXPECT_NE(result.status, 0);
    EXPECT_THAT(result.err, HasSubstr(why));
  };
  refuse_whole("--color-by labels", "the field's voxels are no labels");
  refuse_whole("--color-by missing.raw,labels", "give x, y, z, NX,NY,NZ, depth, volume or a file");
  refuse("--labels 3 --color-by labels --annotate color-bar", "colours of labels have no order");
}

TEST_F(CliLabels, ScenesKeepThem) {
  render(in("seg_25x24x23_uint16.raw") + " --labels 3,red,0.4 --labels 300,,1,whole --clip y -o " +
         in("a.png") + " --save-scene " + in("s.json"));
  EXPECT_THAT(file("s.json"), HasSubstr("\"labels\": [3]"));
  EXPECT_THAT(file("s.json"), Not(HasSubstr("isovalue")));
  render("--scene " + in("s.json") + " -o " + in("b.png"));
  EXPECT_EQ(file("a.png"), file("b.png"));
}

TEST_F(CliLabels, PicturesHaveANameWithoutAnOutput) {
  const test::ProgramResult result =
      test::run_command("cd " + quoted(folder_ / ".") + " && " + test::isowave_program() +
                        " render seg_25x24x23_uint16.raw --labels 3 --size 16x12 --device cpu");
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("wrote seg_25x24x23_uint16_labels.png"));
}

TEST_F(CliLabels, WhatIsNoLabelIsRefused) {
  refuse("--labels x", "--labels x: 'x' is no label: give whole numbers, 0 to 65535");
  refuse("--labels 65536", "'65536' is no label");
  refuse("--labels 3+", "'' is no label");
  refuse("--labels 7-5", "7 is above 5");
  refuse("--labels 3,,", "give LABELS, LABELS,COLOR");
  refuse("--labels 3,nocolor", "--labels: ");
  refuse("--labels 3,red,2", "an opacity of 2");
  std::string nine;
  for (int i = 0; i < 9; ++i) nine += " --labels 3";
  refuse(nine, "9 surfaces are more than a frame can have");
}

TEST_F(CliLabels, WhatLabelsAreDrawnWithoutIsRefused) {
  for (const char *option : {"-i 3", "--surface 3"})
    refuse("--labels 3 " + std::string(option), "--labels draws surfaces of labels alone");
  for (const char *option :
       {"--voxel-pixels 1", "--voxel-error 1", "--max-surface-error 1", "--max-image-error 0.1",
        "--time-budget 9", "--slice z", "--reference", "--rate 8"})
    refuse("--labels 3 " + std::string(option), "labels are drawn without it: leave it out");
  for (const char *option : {"--ambient 2", "--light 1,0,0 --shadow 1"})
    refuse("--labels 3,,0.5 " + std::string(option), "end at surfaces of opacity 1");
  refuse("--labels 3 --color red", "--color: surfaces have colours of their own");
  refuse("--labels 3 --pipeline blocks", "pipeline blocks draws no labels");
  refuse("--labels 3 --solver linear", "labels need --solver bernstein");
  const test::ProgramResult result = test::run_isowave(
      "render generate:sphere_9x9x9_float32 --labels 1 --size 16x12 --device cpu -o " +
      in("a.png"));
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("voxels of type float32 are no labels"));
}

}  // namespace
}  // namespace isowave::core
