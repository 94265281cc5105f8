// `isowave render --slice`, run as a user runs it: what all renderers draw alike, what the picture
// says of the voxels, and what is refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/io/png.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::expect_one_line_error;
using test::quoted;

class CliSlices : public testing::Test {
 protected:
  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  void render(const std::string &options) const {
    const test::ProgramResult result = test::run_isowave("render " + options);
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliSlices, AllRenderersDrawTheSameBits) {
  const std::string fuel = ISOWAVE_TEST_DATA
      "/fuel_64x33x32_uint8.raw.gz --size 48x36 -i 40 --slice z,20 --slice 1,0,1 "
      "--slice-opacity 0.7 --slice-range 0,120 --clip y ";
  render(fuel + "--reference -o " + in("a.png") + " --stats " + in("s.json"));
  for (const char *renderer : {"host", "cpu"}) {
    render(fuel + "--device " + renderer + " -o " + in("b.png"));
    EXPECT_EQ(test::read_file(folder_ / "b.png"), test::read_file(folder_ / "a.png")) << renderer;
  }
  const auto stats = nlohmann::json::parse(test::read_file(folder_ / "s.json"));
  EXPECT_EQ(stats["options"]["slices"].size(), 2u);
  EXPECT_GT(stats["frames"][0]["layers"]["hits"], stats["frames"][0]["rays_hit"]);
}

/// The middle slice of a ball whose value is 1 in the middle: white there, darker around.
TEST_F(CliSlices, APictureHasTheVoxelsValues) {
  test::write_file(folder_ / "c.json", R"({"width":33,"height":33,"fovy_deg":60,"cameras":[
      {"eye":[16,16,116],"at":[16,16,16],"up":[0,1,0],"parallel_height":33}]})");
  render(
      "generate:sphere_33x33x33_float32 --exact -i 2 --slice z --slice-range 0,1 --device host "
      "--cameras " +
      in("c.json") + " -o " + in("a.png"));
  const Image8 picture = read_png(folder_ / "a.png");
  const auto gray = [&](std::size_t x, std::size_t y) { return picture.pixels[3 * (x + 33 * y)]; };
  for (std::size_t x = 0; x < 33; ++x) {  // generate:sphere is 1 - distance / the largest
    const double distance = std::abs(static_cast<double>(x) - 16) / (16 * std::sqrt(3.0));
    EXPECT_NEAR(gray(x, 16), 255 * (1 - distance), 1) << x;
  }
}

TEST(CliSliceOptions, WhatIsNoSliceIsRefused) {
  const std::string render = "render generate:sphere_9x9x9_float32 --size 16x12 -i 0.5 ";
  const auto refuse = [&](const std::string &options, std::string_view text) {
    expect_one_line_error(render + options, text);
  };
  refuse("--slice w", "--slice w: 'w' is no finite number");
  refuse("--slice 1,0", "--slice 1,0: give NX,NY,NZ or NX,NY,NZ,D");
  refuse("--slice 0,0,0", "--slice 0,0,0: the plane's normal is 0 0 0");
  refuse("--slice z,", "--slice z,: give");
  refuse("--slice z --slice-range 1", "--slice-range 1: give LOW,HIGH");
  refuse("--slice z --slice-range 1,1", "two numbers that differ");
  refuse("--slice z --slice-opacity 0", "--slice-opacity");
  refuse("--slice z --slice-map rainbow", "--slice-map");
  refuse("--slice-map gray", "--slice");
  std::string eight;
  for (int i = 0; i < 8; ++i) eight += " --slice z";
  refuse(eight, "1 surfaces and 8 slices are more than a frame can have");
  for (const char *option : {"--max-image-error 0.1", "--time-budget 9"})
    refuse("--slice z " + std::string(option), "--slice draws without it: leave out either");
  refuse("--slice z --pipeline blocks", "--slice: --pipeline blocks draws one opaque surface");
  refuse("--slice z --solver linear", "--slice: needs --solver bernstein");
  refuse("--slice z --depth d.npy", "--slice: no picture is written: give --output");
}

}  // namespace
}  // namespace isowave::core
