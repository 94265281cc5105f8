// `isowave render --transparent`, run as a user runs it.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::quoted;

const std::string kHead = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz -i 80 --size 48x36 ";

class CliTransparent : public testing::Test {
 protected:
  void render(const std::string &options) const {
    const auto result = test::run_isowave("render " + kHead + options);
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
  }
  std::string in(const char *name) const { return quoted(folder_ / name); }

  test::TemporaryFolder folder_;
};

TEST_F(CliTransparent, AlphaIsTheShareOfRaysThatHit) {
  for (const std::size_t samples : {1u, 2u, 3u}) {
    const std::string rays = fmt::format("--samples {} ", samples);
    render(rays + "--transparent -o " + in("a.png") + " --depth " + in("d.npy") + " --stats " +
           in("s.json"));
    const Image8 picture = read_png(folder_ / "a.png");
    ASSERT_EQ(picture.channels, 4u);
    const FloatImage depth = read_npy(folder_ / "d.npy");
    ASSERT_EQ(depth.pixels.size(), samples * samples * 48 * 36);
    std::vector<std::size_t> num_hits(std::size_t{48} * 36);
    for (std::size_t ray = 0; ray < depth.pixels.size(); ++ray) {
      const std::size_t row = ray / depth.width / samples, column = ray % depth.width / samples;
      num_hits[48 * row + column] += std::isfinite(depth.pixels[ray]);
    }
    std::size_t num_mixed = 0;
    for (std::size_t pixel = 0; pixel < num_hits.size(); ++pixel) {
      const double share = double(num_hits[pixel]) / double(samples * samples);
      ASSERT_EQ(picture.pixels[4 * pixel + 3], std::lround(255 * share)) << "pixel " << pixel;
      num_mixed += share > 0 && share < 1;
    }
    EXPECT_EQ(num_mixed > 20, samples > 1);
    const json stats = json::parse(test::read_file(folder_ / "s.json"));
    EXPECT_EQ(stats["options"]["transparent"], true);
    for (const char *by : {"--reference", "--device host", "--device cpu --pipeline blocks"}) {
      render(rays + "--transparent -o " + in("b.png") + " " + by);
      EXPECT_TRUE(test::read_file(folder_ / "b.png") == test::read_file(folder_ / "a.png")) << by;
    }
  }
  render("-o " + in("a.png") + " --stats " + in("s.json"));
  EXPECT_EQ(read_png(folder_ / "a.png").channels, 3u);
  EXPECT_EQ(json::parse(test::read_file(folder_ / "s.json"))["options"]["transparent"], false);
}

TEST_F(CliTransparent, EveryPictureIsTransparent) {
  render("--transparent --cache-slots 64 -o " + in("a.png") + " --progress-dir " + in("p"));
  EXPECT_EQ(read_png(folder_ / "p" / "pass0001.png").channels, 4u);
  render("--transparent --time-budget 1000000 -o " + in("b.png") + " --refined " + in("c.png"));
  for (const char *name : {"b.png", "c.png"})
    EXPECT_TRUE(test::read_file(folder_ / name) == test::read_file(folder_ / "a.png")) << name;
}

TEST_F(CliTransparent, WhatHasNoEffectIsRefused) {
  const std::string command = "render " + kHead + "--transparent ";
  expect_one_line_error(command + "--background '#FFFFFF' -o " + in("a.png"),
                        "--background: pictures with --transparent have none");
  expect_one_line_error(command + "--background black,white -o " + in("a.png"),
                        "--background: pictures with --transparent have none");
  expect_one_line_error(command + "--depth " + in("d.npy"),
                        "--transparent: no picture is written: give --output");
}

}  // namespace
}  // namespace isowave::core
