// Series of volumes in `isowave render`: each step is the picture that the step alone has, with the
// camera of the first.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/io/png.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::quoted;
using test::run_command;
using testing::HasSubstr;

constexpr int kSize = 16, kNumSteps = 11;

/// A ball that grows with the steps, away from the middle; values fall from its centre.
std::string ball(int step, int size = kSize) {
  std::string voxels;
  for (int z = 0; z < size; ++z)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        const int squared = (x - 6) * (x - 6) + (y - 7) * (y - 7) + (z - 8) * (z - 8);
        voxels += static_cast<char>(std::max(0, 100 + 4 * step - 3 * squared));
      }
  return voxels;
}

class CliSeries : public testing::Test {
 protected:
  CliSeries() {
    std::string all = "NRRD0004\ntype: uint8\nencoding: raw\ndimension: 4\nsizes: 16 16 16 11\n\n";
    for (int step = 0; step < kNumSteps; ++step) {
      test::write_file(folder_ / ("b" + std::to_string(step) + "_16x16x16_uint8.raw"), ball(step));
      all += ball(step);
    }
    test::write_file(folder_ / "four.nrrd", all);
  }
  std::string in(const std::string &name) const { return quoted(folder_ / name); }
  std::string bytes(const std::string &name) const {
    EXPECT_TRUE(std::filesystem::exists(folder_ / name)) << name;
    return test::read_file(folder_ / name);
  }
  std::string pattern() const { return in("b*_16x16x16_uint8.raw"); }
  static std::string draw(const std::string &volume, const std::string &options) {
    return "render --device host --size 32x24 " + volume + " " + options;
  }
  static test::ProgramResult run(const std::string &arguments) {
    const test::ProgramResult result = test::run_isowave(arguments);
    EXPECT_EQ(result.status, 0) << arguments << "\n" << result.err;
    return result;
  }
  /// A camera file of the first frame of these statistics.
  void write_first_camera(const std::string &stats, const std::string &name) const {
    const json camera = json::parse(bytes(stats))["frames"][0]["camera"];
    test::write_file(
        folder_ / name,
        json({{"fovy_deg", camera["fovy_deg"]},
              {"cameras", {{{"eye", camera["eye"]}, {"at", camera["at"]}, {"up", camera["up"]}}}}})
            .dump());
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliSeries, EachStepIsDrawnWithTheCameraOfTheFirst) {
  run(draw(pattern(), "-i 60 -o " + in("p.png") + " --stats " + in("s.json")));
  const json frames = json::parse(bytes("s.json"))["frames"];
  ASSERT_EQ(frames.size(), std::size_t{kNumSteps});
  write_first_camera("s.json", "c.json");
  for (const int step : {0, 2, 9, 10}) {
    EXPECT_EQ(frames[std::size_t(step)]["step"], step);
    EXPECT_EQ(frames[std::size_t(step)]["camera"], frames[0]["camera"]);
    run(draw(in("b" + std::to_string(step) + "_16x16x16_uint8.raw"),
             "-i 60 --cameras " + in("c.json") + " -o " + in("one.png")));
    const std::string number = step < 10 ? "0" + std::to_string(step) : std::to_string(step);
    EXPECT_EQ(bytes("p_step" + number + ".png"), bytes("one.png")) << step;
  }
  EXPECT_GT(frames[10]["rays_hit"], frames[0]["rays_hit"]) << "else the steps are not seen";
  // The view is what the first step alone would have.
  run(draw(in("b0_16x16x16_uint8.raw"), "-i 60 -o " + in("one.png")));
  EXPECT_EQ(bytes("p_step00.png"), bytes("one.png"));
}

TEST_F(CliSeries, AFourthAxisIsTheSameSeries) {
  run(draw(pattern(), "-i 60 -o " + in("p.png") + " --steps 3:10:7"));
  run(draw(in("four.nrrd"), "-i 60 -o " + in("f.png") + " --steps 3:10:7"));
  for (const char *step : {"03", "10"})
    EXPECT_EQ(bytes("f_step" + std::string(step) + ".png"),
              bytes("p_step" + std::string(step) + ".png"));
}

TEST_F(CliSeries, StepsAreChosen) {
  const auto drawn = [&](const std::string &steps) {
    run(draw(in("four.nrrd"), "-i 60 --stats " + in("s.json") + " --steps " + steps));
    std::vector<int> numbers;
    const json frames = json::parse(bytes("s.json"))["frames"];
    for (const json &frame : frames) numbers.push_back(frame["step"].get<int>());
    return numbers;
  };
  EXPECT_EQ(drawn("2:4"), (std::vector{2, 3, 4}));
  EXPECT_EQ(drawn("1:10:4"), (std::vector{1, 5, 9}));
  EXPECT_EQ(drawn("7"), std::vector{7});
  EXPECT_EQ(drawn("0:10:18446744073709551615"), std::vector{0});
  const auto refused = [&](const std::string &steps, std::string_view text) {
    expect_one_line_error(draw(in("four.nrrd"), "-i 60 --steps " + steps), text);
  };
  refused("2:11", "the series has 11 steps, 0 to 10");
  refused("4:2", "comes after the last");
  refused("2:4:0", "a stride of 0");
  for (const char *wrong : {"a", "2:", ":3", "1:2:3:4", "1-3", "2:4:"}) refused(wrong, "--steps");
}

TEST_F(CliSeries, MoviesHaveStepsInTheirOrder) {
  const std::string said =
      run(draw(pattern(), "-i 40 -i 60 --turntable 2 --steps 0:10:5 -o " + in("p.png") +
                              " --movie " + in("m.mp4") + " --fps 10 --stats " + in("s.json")))
          .out;
  EXPECT_THAT(said, HasSubstr("m.mp4: 12 pictures, 1.2 s at --fps 10\n"));
  EXPECT_FALSE(bytes("p_iso40_view1_step05.png").empty());
  std::vector<std::vector<int>> order;
  const json frames = json::parse(bytes("s.json"))["frames"];
  for (const json &frame : frames)
    order.push_back(
        {frame["step"].get<int>(), frame["isovalue"].get<int>(), frame["view"].get<int>()});
  EXPECT_EQ(order.size(), 12u);
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
  const test::ProgramResult counted = run_command(
      "ffprobe -v error -count_frames -show_entries stream=nb_read_frames -of csv=p=0 " +
      in("m.mp4"));
  EXPECT_EQ(counted.out, "12\n");
}

TEST_F(CliSeries, OtherOutputsAreNamedByTheStep) {
  run(draw(pattern(), "-i 60 --steps 9:10 --depth " + in("d.npy")));
  EXPECT_FALSE(bytes("d_step09.npy").empty());
  EXPECT_NE(bytes("d_step09.npy"), bytes("d_step10.npy"));
  // Without -o, names are made of the pattern.
  const test::ProgramResult result =
      run_command("cd " + quoted(folder_.path()) + " && " + test::isowave_program() + " " +
                  draw("'b*_16x16x16_uint8.raw'", "-i 60 --steps 9:10"));
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_FALSE(bytes("b_16x16x16_uint8_iso60_step09.png").empty());
  EXPECT_THAT(result.out, HasSubstr("wrote b_16x16x16_uint8_iso60_stepT.png"));
}

TEST_F(CliSeries, ADeviceDrawsTheSamePictures) {
  run(draw(pattern(), "-i 60 --steps 0:10:5 -o " + in("h.png")));
  run("render --size 32x24 " + pattern() + " -i 60 --steps 0:10:5 -o " + in("d.png"));
  for (const char *step : {"00", "05", "10"})
    EXPECT_EQ(bytes("d_step" + std::string(step) + ".png"),
              bytes("h_step" + std::string(step) + ".png"));
}

TEST_F(CliSeries, TheSuggestedIsovalueIsTheFirstSteps) {
  const test::ProgramResult of_all =
      run(draw(pattern(), "-o " + in("a.png") + " --steps 0:1 --stats " + in("s.json")));
  EXPECT_THAT(of_all.out, HasSubstr("is suggested"));
  const test::ProgramResult of_first =
      run(draw(in("b0_16x16x16_uint8.raw"), "-o " + in("b.png") + " --stats " + in("t.json")));
  const json frames = json::parse(bytes("s.json"))["frames"];
  EXPECT_EQ(frames[0]["isovalue"], json::parse(bytes("t.json"))["frames"][0]["isovalue"]);
  EXPECT_EQ(frames[1]["isovalue"], frames[0]["isovalue"]);
}

TEST_F(CliSeries, CompressedStepsAreDrawnAsTheyAre) {
  for (int step : {0, 1}) {
    const std::string number = std::to_string(step);
    run("convert " + in("b" + number + "_16x16x16_uint8.raw") + " -o " + in("z" + number + ".zfp"));
  }
  run(draw(in("z*.zfp"), "-i 60 -o " + in("z.png")));
  run(draw(pattern(), "-i 60 -o " + in("p.png") + " --steps 0:1"));
  EXPECT_EQ(bytes("z_step1.png"), bytes("p_step01.png"));
  expect_one_line_error(draw(in("z*.zfp"), "-i 60 --rate 8 -o " + in("q.png")),
                        "is compressed already");
}

/// --index takes one volume of a file with a fourth axis, in each command.
TEST_F(CliSeries, AnIndexIsOneVolumeOfAFile) {
  const std::string four = in("four.nrrd") + " --index t=3 ", alone = in("b3_16x16x16_uint8.raw");
  run(draw(four, "-i 60 -o " + in("i.png")));
  run(draw(alone, "-i 60 -o " + in("a.png")));
  EXPECT_EQ(bytes("i.png"), bytes("a.png"));
  run(draw(in("b10_16x16x16_uint8.raw"), "-i 60 -o " + in("last.png")));
  EXPECT_NE(bytes("a.png"), bytes("last.png")) << "else the steps are not told apart";
  run("convert " + four + "-o " + in("i.zfp"));
  run("convert " + alone + " -o " + in("a.zfp"));
  EXPECT_EQ(bytes("i.zfp"), bytes("a.zfp"));
  const auto info = [&](const std::string &volume) {
    json found = json::parse(run("info --json " + volume).out);
    for (const char *of_file : {"file", "file_bytes"}) found.erase(of_file);
    return found;
  };
  EXPECT_EQ(info(four), info(alone));
  EXPECT_NE(info(four), info(in("b4_16x16x16_uint8.raw")));
  run("extract --device cpu " + four + "-i 60 -o " + in("i.ply"));
  run("extract --device cpu " + alone + " -i 60 -o " + in("a.ply"));
  EXPECT_EQ(bytes("i.ply"), bytes("a.ply"));
  const std::string same = run("compare " + four + in("four.nrrd") + " -i 60 --size 32x24").out;
  EXPECT_THAT(same, HasSubstr("equal: all bits of 4096 voxels"));
  // The field of a surface has an index of its own.
  for (const auto &[field, name] : {std::pair{in("four.nrrd") + ",40,120 --field-index t=10", "f"},
                                    std::pair{in("b10_16x16x16_uint8.raw") + ",40,120", "g"},
                                    std::pair{in("four.nrrd") + ",40,120", "own"}})
    run(draw(four, "-i 60 --color-by " + field + " -o " + in(name + std::string(".png"))));
  EXPECT_EQ(bytes("f.png"), bytes("g.png"));
  EXPECT_NE(bytes("f.png"), bytes("own.png"));
}

TEST_F(CliSeries, AnIndexThatCannotBeIsOneLine) {
  const std::string out = " -o " + in("p.zfp");
  const auto convert = [&](const std::string &volume) { return "convert " + volume + out; };
  expect_one_line_error(convert(in("four.nrrd")), "a series of 11 steps; choose one by index");
  expect_one_line_error(convert(in("four.nrrd") + " --index t=11"),
                        "step 11 of a file that has 11");
  for (const char *index : {"3", "t=", "t=x", "t=-1", "c=1", "t=1,c=0", "t=4294967296"})
    expect_one_line_error(convert(in("four.nrrd") + " --index " + index),
                          std::string("--index ") + index + ": give t=N, counted from 0");
  const std::string one = in("b3_16x16x16_uint8.raw");
  run("convert " + one + " -o " + in("v.zfp"));
  for (const std::string &volume : {one, std::string("generate:sphere_8x8x8_uint8")})
    expect_one_line_error(convert(volume + " --index t=1"),
                          "index t=1: it is one volume: leave the index out");
  for (const char *command : {"info ", "render --device host "})
    expect_one_line_error(command + in("v.zfp") + " --index t=2", "index t=2: it is one volume");
  EXPECT_THAT(test::run_isowave("extract --device cpu " + in("v.zfp") + " --index t=2").err,
              HasSubstr("index t=2: it is one volume"));
  run("info " + in("v.zfp") + " --index t=0");
  expect_one_line_error(draw(in("four.nrrd"), "-i 60 --index t=1 --steps 0:2"),
                        "VOLUME is no series");
  expect_one_line_error(draw(one, "-i 60 --field-index t=1"),
                        "--field-index: no file's values colour the surface");
}

TEST_F(CliSeries, WhatCannotBeIsOneLineAndLeavesNothing) {
  const std::size_t before = folder_.num_files();
  const auto refused = [&](const std::string &volume, const std::string &options,
                           std::string_view text) {
    expect_one_line_error(draw(volume, "-i 60 " + options), text);
  };
  refused(in("absent*.raw"), "-o " + in("p.png"), "no file has such a name");
  refused(pattern(), "-o " + in("p.png") + " --save-scene " + in("s.json"), "VOLUME is a series");
  refused(in("b0_16x16x16_uint8.raw"), "--steps 0:1 -o " + in("p.png"), "no series");
  refused(pattern(), "-o " + in("p.png") + " --stats " + in("b3_16x16x16_uint8.raw"),
          "take the place of the input");
  EXPECT_EQ(folder_.num_files(), before);
  // A step of another grid is refused before anything is drawn.
  test::write_file(folder_ / "b11_8x8x8_uint8.raw", ball(0, 8));
  refused(in("b*.raw"), "-o " + in("p.png"), "b11_8x8x8_uint8.raw has 8x8x8 voxels");
  EXPECT_EQ(folder_.num_files(), before + 1);
  // What only its voxels show is found when the step is read: no picture of earlier steps is left.
  std::vector<float> voxels(64, 1.0f);
  voxels[5] = 3;
  test::write_file(folder_ / "n0_4x4x4_float32.raw", voxels);
  voxels[5] = std::numeric_limits<float>::infinity();
  test::write_file(folder_ / "n1_4x4x4_float32.raw", voxels);
  const test::ProgramResult result =
      test::run_isowave(draw(in("n*_4x4x4_float32.raw"), "-i 2 -o " + in("p.png")));
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("n1_4x4x4_float32.raw"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "p_step0.png"));
}

}  // namespace
}  // namespace isowave::core
