// Turntables and movies of `isowave render`. ffmpeg decodes the movies again.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/movie.hpp"
#include "core/io/png.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::quoted;
using test::run_command;
using testing::HasSubstr;

constexpr const char *kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz ";
constexpr std::uint32_t kWidth = 48, kHeight = 36;

/// Mean of each channel.
std::array<double, 3> mean_of(const std::uint8_t *rgb, std::size_t num_pixels) {
  std::array<double, 3> mean{};
  for (std::size_t i = 0; i < 3 * num_pixels; ++i) mean.at(i % 3) += rgb[i] / double(num_pixels);
  return mean;
}

/// Mean colour of each frame of a movie.
std::vector<std::array<double, 3>> frame_means(const std::filesystem::path &movie,
                                               std::uint32_t width, std::uint32_t height) {
  const test::ProgramResult decoded =
      run_command("ffmpeg -v error -i " + quoted(movie) + " -f rawvideo -pix_fmt rgb24 -");
  EXPECT_EQ(decoded.status, 0) << decoded.err;
  const std::size_t num_pixels = std::size_t{width} * height;
  EXPECT_EQ(decoded.out.size() % (3 * num_pixels), 0u);
  std::vector<std::array<double, 3>> means;
  for (std::size_t at = 0; at + 3 * num_pixels <= decoded.out.size(); at += 3 * num_pixels)
    means.push_back(
        mean_of(reinterpret_cast<const std::uint8_t *>(decoded.out.data()) + at, num_pixels));
  return means;
}

void expect_same_colors(const std::array<double, 3> &got, const std::array<double, 3> &expected) {
  for (std::size_t channel = 0; channel < 3; ++channel)
    EXPECT_NEAR(got.at(channel), expected.at(channel), 3.0) << "channel " << channel;
}

class CliMovie : public testing::Test {
 protected:
  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  static std::string draw(const std::string &options) {
    const bool has_size = options.find("--size") != std::string::npos;
    return "render --device host " + std::string(has_size ? "" : "--size 48x36 ") + kFuel + options;
  }
  static void run(const std::string &options) {
    const test::ProgramResult result = test::run_isowave(draw(options));
    EXPECT_EQ(result.status, 0) << options << "\n" << result.err;
  }
  std::string bytes(const std::string &name) const { return test::read_file(folder_ / name); }

  test::TemporaryFolder folder_;
};

TEST_F(CliMovie, HasAllPicturesInTheirOrder) {
  run("-i 40 -i 100 --orbit 2 --color red -o " + in("p.png") + " --movie " + in("m.mp4") +
      " --fps 10");
  const auto means = frame_means(folder_ / "m.mp4", kWidth, kHeight);
  const std::vector<std::string> names{"p_iso40_view0.png", "p_iso40_view1.png",
                                       "p_iso100_view0.png", "p_iso100_view1.png"};
  ASSERT_EQ(means.size(), names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Image8 image = read_png(folder_ / names[i]);
    expect_same_colors(means[i], mean_of(image.pixels.data(), image.pixels.size() / 3));
  }
  EXPECT_GT(std::abs(means[0][1] - means[2][1]), 3.0) << "else the order is not seen";
  const test::ProgramResult probed = run_command(
      "ffprobe -v error -show_entries stream=codec_name,pix_fmt,avg_frame_rate -of csv=p=0 " +
      in("m.mp4"));
  EXPECT_EQ(probed.out, "h264,yuv420p,10/1\n");
}

TEST_F(CliMovie, IsWrittenAloneIfAskedFor) {
  run("-i 40 --movie " + in("m.mp4"));
  EXPECT_EQ(folder_.num_files(), 1u) << "no picture is written beside";
  EXPECT_EQ(frame_means(folder_ / "m.mp4", kWidth, kHeight).size(), 1u);
}

TEST_F(CliMovie, WhatCannotBeIsOneLineAndLeavesNothing) {
  const auto refused = [&](const std::string &options, std::string_view text) {
    expect_one_line_error(draw("-i 40 " + options), text);
    EXPECT_EQ(folder_.num_files(), 0u) << options;
  };
  refused("--movie " + in("m.mp4") + " --size 47x36", "even width and height");
  refused("--movie " + in("m.mp4") + " --size 48x35", "even width and height");
  refused("--movie " + in("m.avi"), "end the name in .mp4");
  refused("--movie " + in("m.mp4") + " --fps 0", "0.1 to 1000");
  refused("--movie " + in("m.mp4") + " --transparent", "no transparency");
  refused("--movie " + in("m.mp4") + " --time-budget 5", "--time-budget");
  refused("--movie " + in("m.mp4") + " --stats " + in("m.mp4"), "take the place of");
  refused("--fps 10 -o " + in("p.png"), "give --movie");
  refused("--movie " + in("absent/m.mp4"), "is no folder");
}

/// Runs with a PATH that has only this ffmpeg; empty: none.
test::ProgramResult run_with(const test::TemporaryFolder &folder, const std::string &ffmpeg,
                             const std::string &arguments) {
  if (!ffmpeg.empty()) {
    test::write_file(folder / "ffmpeg", ffmpeg);
    std::filesystem::permissions(folder / "ffmpeg", std::filesystem::perms::owner_all);
  }
  return run_command("/usr/bin/env PATH=" + quoted(folder.path()) + " " +
                     quoted(test::program_path()) + " " + arguments);
}

TEST_F(CliMovie, NeedsFfmpegBeforeAnythingIsDrawn) {
  const test::TemporaryFolder empty;
  const test::ProgramResult result =
      run_with(empty, "", draw("-i 40 -o " + in("p.png") + " --movie " + in("m.mp4")));
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err, HasSubstr("m.mp4: movies need the program ffmpeg"));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1);
  EXPECT_EQ(folder_.num_files(), 0u);
}

TEST_F(CliMovie, SaysWhyFfmpegFailed) {
  for (const std::string script :
       {"#!/bin/sh\necho first line >&2\necho no such codec >&2\nexit 3\n",
        "#!/bin/sh\n/bin/cat > /dev/null\necho no such codec >&2\nexit 3\n"}) {
    const test::TemporaryFolder programs;
    const test::ProgramResult result = run_with(
        programs, script,
        draw("-i 40 --orbit 9 --size 480x360 -o " + in("p.png") + " --movie " + in("m.mp4")));
    EXPECT_EQ(result.status, 1);
    EXPECT_THAT(result.err, HasSubstr("m.mp4: ffmpeg failed: no such codec\n"));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(folder_.num_files(), 0u) << "also no picture";
  }
}

/// ffmpeg 5.1 ends with status 0 when it could not write all.
TEST_F(CliMovie, AFullDiskKeepsTheOldFile) {
  test::write_file(folder_ / "m.mp4", "old");
  const test::ProgramResult result =
      run_command("ulimit -f 16; " + test::isowave_program() + " " +
                  draw("-i 40 --turntable 40 --size 480x360 --movie " + in("m.mp4")));
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("m.mp4: ffmpeg failed: "));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_EQ(bytes("m.mp4"), "old");
  EXPECT_EQ(folder_.num_files(), 1u);
}

TEST(Movie, NeverEndsTheProcessAndKeepsTheOldFile) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "m.mp4", "old");
  {
    Movie movie(folder / "m.mp4", 4, 2, 25);
    movie.write({4, 2, 3, std::vector<std::uint8_t>(24, 100)});
    EXPECT_THROW(movie.write({2, 2, 3, std::vector<std::uint8_t>(12)}), std::invalid_argument);
  }  // without commit()
  EXPECT_EQ(test::read_file(folder / "m.mp4"), "old");
  EXPECT_EQ(folder.num_files(), 1u);
  EXPECT_THAT([&] { Movie(folder / "m.mp4", 4, 2, 25).commit(); },
              testing::ThrowsMessage<Error>(HasSubstr("without a frame")));
  Movie movie(folder / "m.mp4", 4, 2, 25);
  for (int i = 0; i < 3; ++i) {
    std::vector<std::uint8_t> pixels(24, static_cast<std::uint8_t>(60 * i + 40));
    movie.write({4, 2, 3, pixels});
  }
  movie.commit();
  const auto means = frame_means(folder / "m.mp4", 4, 2);
  ASSERT_EQ(means.size(), 3u);
  for (int i = 0; i < 3; ++i)
    expect_same_colors(means[std::size_t(i)], {60. * i + 40, 60. * i + 40, 60. * i + 40});
}

TEST_F(CliMovie, TurntablesBeginWithTheDefaultViewsDirection) {
  run("-i 40 -o " + in("d.png") + " --turntable 1");
  run("-i 40 -o " + in("a.png"));
  EXPECT_EQ(bytes("d.png"), bytes("a.png")) << "one view is the default view";
  run("-i 40 -o " + in("t.png") + " --turntable 4 --stats " + in("s.json"));
  const json frames = json::parse(bytes("s.json"))["frames"];
  ASSERT_EQ(frames.size(), 4u);
  std::vector<double> hits;
  for (const json &frame : frames) hits.push_back(frame["rays_hit"]);
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_FALSE(bytes("t_iso40_view" + std::to_string(k) + ".png").empty());
  EXPECT_NE(bytes("t_iso40_view0.png"), bytes("t_iso40_view1.png"));
  // A quarter further each time.
  const json at = frames[0]["camera"]["at"];
  for (std::size_t k = 0; k < 4; ++k) {
    const json &eye = frames[k]["camera"]["eye"], &next = frames[(k + 1) % 4]["camera"]["eye"];
    const double x = eye[0].get<double>() - at[0].get<double>();
    const double z = eye[2].get<double>() - at[2].get<double>();
    EXPECT_NEAR(next[0].get<double>() - at[0].get<double>(), z, 1e-9);
    EXPECT_NEAR(next[2].get<double>() - at[2].get<double>(), -x, 1e-9);
    EXPECT_EQ(eye[1], next[1]);
  }
}

TEST_F(CliMovie, TurntablesTurnAGivenCamera) {
  test::write_file(folder_ / "c.json", R"({"fovy_deg":50,"cameras":[
      {"eye":[100,16,16],"at":[32,16,16],"up":[0,0,1]}]})");
  run("-i 40 -o " + in("t.png") + " --turntable 2 --cameras " + in("c.json") + " --stats " +
      in("s.json"));
  const json frames = json::parse(bytes("s.json"))["frames"];
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0]["camera"]["eye"], json({100.0, 16.0, 16.0}));
  EXPECT_NEAR(frames[1]["camera"]["eye"][0].get<double>(), -36, 1e-9);
  EXPECT_NEAR(frames[1]["camera"]["eye"][2].get<double>(), 16, 1e-9);
  // A scene's camera is turned, too.
  run("-i 40 --cameras " + in("c.json") + " -o " + in("p.png") + " --save-scene " + in("s.json"));
  const test::ProgramResult result =
      test::run_isowave("render --device host --size 48x36 --turntable 2 --scene " + in("s.json") +
                        " -o " + in("u.png"));
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(bytes("u_iso40_view0.png"), bytes("p.png"));
  EXPECT_EQ(bytes("u_iso40_view1.png"), bytes("t_iso40_view1.png"));
}

TEST_F(CliMovie, TurntablesRefuseOtherViews) {
  test::write_file(folder_ / "c.json", R"({"fovy_deg":50,"cameras":[
      {"eye":[100,16,16],"at":[32,16,16],"up":[0,0,1]},
      {"eye":[0,16,160],"at":[32,16,16],"up":[0,1,0]}]})");
  const std::string output = " -o " + in("p.png");
  expect_one_line_error(draw("-i 40 --turntable 2 --cameras " + in("c.json") + output),
                        "turns one camera");
  expect_one_line_error(draw("-i 40 --turntable 2 --orbit 2" + output), "--orbit");
  expect_one_line_error(draw("-i 40 --turntable 0" + output), "--turntable");
}

}  // namespace
}  // namespace isowave::core
