// `isowave render --clip`, run as a user runs it: which part of a sphere is drawn, and what is
// refused.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/io/npy.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::quoted;

// A sphere of radius 8 in the middle of the volume, at (16, 16, 16).
constexpr double kRadius = 8, kMiddle = 16, kEye = 116;
const std::string kSphere = "generate:sphere_33x33x33_float32 --exact -i " +
                            fmt::format("{}", 1 - kRadius / kMiddle / std::sqrt(3.0));

/// Depths in parallel projection along -z, from z = kEye. A pixel is half a voxel wide. The host
/// draws: it has no kernels to compile.
class CliClip : public testing::Test {
 protected:
  CliClip() {
    test::write_file(folder_ / "c.json", R"({"width":48,"height":48,"fovy_deg":60,"cameras":[
        {"eye":[16,16,116],"at":[16,16,16],"up":[0,1,0],"parallel_height":24}]})");
  }
  FloatImage draw(const std::string &options) const {
    const auto result = test::run_isowave("render --device host " + kSphere + " --cameras " +
                                          quoted(folder_ / "c.json") + " --depth " +
                                          quoted(folder_ / "d.npy") + " " + options);
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
    return read_npy(folder_ / "d.npy");
  }
  /// The distance of a pixel's ray from the sphere's axis [voxels].
  static double off_axis(const FloatImage &image, std::size_t pixel) {
    const double x = double(pixel % image.width) + 0.5 - 24,
                 y = double(pixel / image.width) + 0.5 - 24;
    return std::hypot(x, y) / 2;
  }

  test::TemporaryFolder folder_;
};

/// The half behind the middle stays: a disc of the sphere's radius in front, the far half behind.
TEST_F(CliClip, APlaneThroughTheMiddle) {
  const FloatImage capped = draw("--clip 0,0,-1"), open = draw("--clip 0,0,-1 --no-caps");
  std::size_t inside = 0;
  for (std::size_t pixel = 0; pixel < capped.pixels.size(); ++pixel) {
    const double distance = off_axis(capped, pixel);
    if (std::abs(distance - kRadius) < 0.1) continue;
    const bool hits = distance < kRadius;
    ASSERT_EQ(std::isfinite(capped.pixels[pixel]), hits) << pixel;
    ASSERT_EQ(std::isfinite(open.pixels[pixel]), hits) << pixel;
    if (!hits) continue;
    ++inside;
    EXPECT_NEAR(capped.pixels[pixel], kEye - kMiddle, 1e-4) << pixel;
    const double behind = std::sqrt(kRadius * kRadius - distance * distance);
    EXPECT_NEAR(open.pixels[pixel], kEye - kMiddle + behind, 0.2) << pixel;
  }
  EXPECT_GT(inside, 700u);
}

TEST_F(CliClip, EveryWayToSayAPlane) {
  const FloatImage middle = draw("--clip 0,0,-1");
  for (const char *same : {"--clip 0,0,-1,-16", "--clip 0,0,-0.125,-16", "--clip-box ,,,,,16",
                           "--clip=0,0,-1 --clip 0,0,1,-50", "--clip-box -9,99,,,-1e9,16"})
    EXPECT_EQ(draw(same).pixels, middle.pixels) << same;
  EXPECT_NE(draw("--clip 0,0,-2,-12").pixels, middle.pixels);
}

TEST_F(CliClip, HitsAreInTheBoxThatStays) {
  const FloatImage depth = draw("--clip-box 14,20,10,,12,19");
  std::size_t hits = 0;
  for (std::size_t pixel = 0; pixel < depth.pixels.size(); ++pixel) {
    if (!std::isfinite(depth.pixels[pixel])) continue;
    ++hits;
    const double x = kMiddle + (double(pixel % 48) + 0.5 - 24) / 2,
                 y = kMiddle - (double(pixel / 48) + 0.5 - 24) / 2,
                 z = kEye - double(depth.pixels[pixel]);
    EXPECT_TRUE(x > 14 && x < 20 && y > 10 && z > 12 - 1e-3 && z < 19 + 1e-3) << pixel;
  }
  EXPECT_GT(hits, 100u);
}

TEST_F(CliClip, AllRenderersDrawTheSameBits) {
  for (const std::string options :
       {"--clip 1,1,1", "--clip 1,1,1 --no-caps", "--clip 1,0.2,-0.3,9 --clip-box 10,18,,,,18",
        "--clip 1,1,1 --samples 2 --levels all --voxel-pixels 2", "--clip 1,1,1 --orbit 3"}) {
    const std::string views =
        options.find("--orbit") == options.npos ? "--cameras " + quoted(folder_ / "c.json") : "";
    const auto bits = [&](const std::string &by) {
      const test::TemporaryFolder out;
      const auto result = test::run_isowave(
          fmt::format("render {} {} {} --size 48x36 --depth {} -o {} {}", kSphere, options, views,
                      quoted(out / "d.npy"), quoted(out / "a.png"), by));
      EXPECT_EQ(result.status, 0) << options << by << "\n" << result.err;
      return test::run_command("cat " + (out / "*").string()).out;
    };
    const std::string twin = bits("--reference");
    EXPECT_GT(twin.size(), 48u * 36 * 4);
    EXPECT_TRUE(bits("--device host") == twin) << options;
    EXPECT_TRUE(bits("--device cpu") == twin) << options;
  }
}

TEST_F(CliClip, StatisticsTellOfThePlanes) {
  const auto options = [&](const std::string &clip) {
    draw(clip + " --stats " + quoted(folder_ / "s.json"));
    return json::parse(test::read_file(folder_ / "s.json")).at("options").at("clip");
  };
  EXPECT_EQ(options(""), json::parse(R"({"planes":[],"caps":true})"));
  EXPECT_EQ(options("--clip 0,3,0 --clip-box ,,,,,20 --no-caps"), json::parse(R"({"planes":[
      {"normal":[0.0,1.0,0.0],"offset":16.0},{"normal":[0.0,0.0,-1.0],"offset":-20.0}],
      "caps":false})"));
}

TEST(CliClipOptions, WhatIsNoPlaneIsRefused) {
  const std::string render = "render " + kSphere + " --size 16x12 ";
  const auto refuse = [&](const std::string &options, std::string_view text) {
    expect_one_line_error(render + options, text);
  };
  for (const char *value : {"1,0", "1,0,0,1,1", "1,,0", "1,0,0,", ",", "0,1,0,,"})
    refuse(std::string("--clip ") + value,
           fmt::format("--clip {}: give NX,NY,NZ or NX,NY,NZ,D", value));
  refuse("--clip 1,0,nan", "--clip 1,0,nan: 'nan' is no finite number");
  refuse("--clip 1,0,0,1e400", "'1e400' is no finite number");
  refuse("--clip 1,0,0x", "'0x' is no finite number");
  refuse("--clip 0,0,0", "normal is 0 0 0: give a direction");
  refuse("--clip 1e200,0,0", "normal is 1e+200 0 0: give a direction");
  refuse("--clip ''", "--clip: the value is empty");
  refuse("--clip --no-caps", "--clip: a value is missing before --no-caps");
  refuse("--clip-box 0,1,0,1,0", "--clip-box 0,1,0,1,0: give X0,X1,Y0,Y1,Z0,Z1");
  refuse("--clip-box ,,,,,", "give at least one of its sides");
  refuse("--clip-box 0,1,3,3,0,1", "ends at 3 along y, and begins at 3");
  refuse("--clip-box ,,,,,9 --clip-box 9,,,,,", "--clip-box");
  refuse("--no-caps", "--no-caps: nothing is cut: give --clip or --clip-box");
  std::string many;
  for (int i = 0; i < 9; ++i) many += "--clip 0,0,1 ";
  refuse(many + "--clip-box 0,1,0,1,0,1", "15 clipping planes: up to 14 can be drawn");
}

/// Every ray of twin and device, judged by the oracle of clipped frames.
TEST(CliClipVerify, FramesAreTheOracles) {
  test::TemporaryFolder folder;
  const std::string frames =
      "verify " + kSphere + " --size 48x36 --clip 0.2,-1,0.1 --clip-box ,,,,,28";
  for (const std::string options : {"", " --no-caps", " --device cpu"}) {
    const auto result =
        test::run_isowave(frames + options + " --json " + quoted(folder / "v.json"));
    ASSERT_EQ(result.status, 0) << options << "\n" << result.err;
    const json frame = json::parse(test::read_file(folder / "v.json"))["frames"][0];
    EXPECT_EQ(frame["oracle"], "clip");
    EXPECT_EQ(frame["rays"], 48 * 36);
    EXPECT_GT(frame["hits"], 10);
    EXPECT_EQ(frame["caps"] > 10, options != " --no-caps") << frame;
    EXPECT_LT(frame["undecided"], 5);
    for (const char *failure :
         {"missed", "false", "wrong_kinds", "wrong_places", "wrong_gradients"})
      EXPECT_EQ(frame[failure], 0) << failure;
  }
}

TEST(CliClipOptions, WhatVerifyCannotClip) {
  expect_one_line_error("verify --clip 1,0,0", "--clip: is for frames: give a VOLUME");
  const std::string frames = "verify " + kSphere + " --clip 1,0,0 ";
  expect_one_line_error(frames + "--oracle roots", "--oracle: clipped frames have an oracle");
  expect_one_line_error(frames + "--max-surface-error 1", "--max-surface-error: errors are proven");
}

TEST(CliClipOptions, WhatDrawsWholeSurfacesRefusesThem) {
  const std::string render = "render " + kSphere + " --size 16x12 --clip 1,0,0 ";
  expect_one_line_error(
      render + "--max-surface-error 1",
      "--clip: --max-surface-error is proven of whole surfaces: give --by sample");
  expect_one_line_error(render + "--pipeline blocks", "--clip: --pipeline blocks draws whole");
}

}  // namespace
}  // namespace isowave::core
