// isowave extract, run as a user runs it: what it writes, and how it fails.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::expect_one_line_error;
using test::ProgramResult;
using test::quoted;
using test::read_file;
using test::run_command;
using test::run_isowave;
using testing::HasSubstr;

const std::filesystem::path kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";

class CliExtract : public testing::Test {
 protected:
  /// Runs `isowave extract FUEL -i 10 ARGUMENTS --stats ...` and returns the statistics.
  nlohmann::json extract(const std::string &arguments) {
    const auto stats = folder_ / "stats.json";
    const ProgramResult result = run_isowave("extract " + quoted(kFuel) + " -i 10 --exact " +
                                             arguments + " --stats " + quoted(stats));
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(result.err, "");
    EXPECT_THAT(result.out, HasSubstr("wrote "));
    return nlohmann::json::parse(read_file(stats));
  }

  test::TemporaryFolder folder_;
};

TEST_F(CliExtract, BatchesGiveTheSameFile) {
  const auto all = folder_ / "all.ply", few = folder_ / "few.ply";
  const nlohmann::json at_once = extract("-o " + quoted(all)),
                       batches = extract("--cache-slots 40 --stream host -o " + quoted(few));
  EXPECT_EQ(read_file(all), read_file(few));
  EXPECT_EQ(at_once["decoded_blocks"], at_once["needed_blocks"]);
  EXPECT_GT(batches["decoded_blocks"], at_once["decoded_blocks"]);
  const std::string header = read_file(all).substr(0, 300);
  EXPECT_THAT(header, HasSubstr("element vertex " + at_once["vertices"].dump() + "\n"));
  EXPECT_THAT(header, HasSubstr("element face " + at_once["triangles"].dump() + "\n"));
  EXPECT_GT(at_once["triangles"].get<int>(), 1000);
}

TEST_F(CliExtract, EveryFormatAndOption) {
  const nlohmann::json plain = extract("-o " + quoted(folder_ / "a.stl"));
  EXPECT_EQ(std::filesystem::file_size(folder_ / "a.stl"),
            84 + 50 * plain["triangles"].get<std::size_t>());
  const nlohmann::json bare = extract("--normals none -o " + quoted(folder_ / "a.ply"));
  EXPECT_LT(bare["needed_blocks"], plain["needed_blocks"]);
  EXPECT_EQ(bare["triangles"], plain["triangles"]);
  EXPECT_THAT(read_file(folder_ / "a.ply").substr(0, 300),
              testing::Not(HasSubstr("property float nx")));
  const nlohmann::json coarse = extract("--level 1 -o " + quoted(folder_ / "a.obj"));
  EXPECT_LT(coarse["triangles"], plain["triangles"]);
  EXPECT_EQ(coarse["volume"]["dims"], (nlohmann::json{33, 17, 17}));
  for (const char *name : {"a.vtp", "a.gltf", "a.glb"}) {
    extract("--memory-budget 2MB -o " + quoted(folder_ / name));
    EXPECT_GT(std::filesystem::file_size(folder_ / name), 1000u);
  }
}

/// As admesh judges, which merges vertices by position.
TEST_F(CliExtract, ClosedMeshesAreWatertight) {
  const auto file = folder_ / "a.stl";
  const auto judge = [&] { return run_command("admesh " + quoted(file)).out; };
  const auto open = testing::ContainsRegex("Total disconnected facets +: +[1-9]");
  const auto closed = testing::ContainsRegex("Total disconnected facets +: +0 ");
  extract("-o " + quoted(file));
  EXPECT_THAT(judge(), open);
  const nlohmann::json whole = extract("--closed -o " + quoted(file));
  EXPECT_THAT(judge(), testing::AllOf(closed, testing::ContainsRegex("Facets reversed +: +0")));
  EXPECT_TRUE(whole["closed"]);
  const nlohmann::json less = extract("--closed --largest 1 --simplify 0.25 -o " + quoted(file));
  EXPECT_THAT(judge(), testing::AllOf(closed, testing::ContainsRegex("Number of parts +: +1 ")));
  EXPECT_NEAR(less["triangles"].get<double>() / whole["triangles"].get<double>(), 0.25, 0.02);
  EXPECT_GT(less["simplify_error"], 0);
  EXPECT_EQ(std::filesystem::file_size(file), 84 + 50 * less["triangles"].get<std::size_t>());
}

TEST_F(CliExtract, TheNameIsMadeUp) {
  const ProgramResult result =
      run_command("cd " + quoted(folder_.path()) + " && " + test::isowave_program() + " extract " +
                  quoted(kFuel) + " -i 300");
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("0 vertices, 0 triangles"));
  EXPECT_THAT(result.err,
              HasSubstr("warning: isovalue 300 is outside the volume's values, 0 to 255"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "fuel_64x33x32_uint8_iso300.ply"));
}

// The line is convert's.
TEST_F(CliExtract, SaysHowAVolumeIsCompressedInMemory) {
  for (const auto &[options, text] : {std::pair("", "whole numbers, max error 0"),
                                      {"--rate 8", "8 bits per voxel, fixed rate"},
                                      {"--tolerance 3", "fixed accuracy, max error "}}) {
    const ProgramResult converted = run_isowave(
        fmt::format("convert {} {} {} -o {}", quoted(kFuel), options,
                    std::string_view(options).starts_with("--rate") ? "--no-verify" : "",
                    quoted(folder_ / "a.zfp")));
    for (const std::string &command : std::vector<std::string>{
             "extract --device cpu -o " + quoted(folder_ / "a.ply"),
             "render --device cpu --size 16x8 -o " + quoted(folder_ / "a.png"),
             "render --reference --size 16x8 -o " + quoted(folder_ / "a.png")}) {
      const std::string arguments =
          fmt::format("{} -i 80 --stats {} ", command, quoted(folder_ / "a.json"));
      const ProgramResult result = run_isowave(arguments + options + " " + quoted(kFuel));
      ASSERT_EQ(result.status, 0) << result.err;
      const std::size_t begin = result.out.find("compressed in memory: ");
      ASSERT_NE(begin, std::string::npos) << result.out;
      const std::string line =
          result.out.substr(begin + 22, result.out.find('\n', begin) - begin - 22);
      EXPECT_THAT(line, HasSubstr(text));
      EXPECT_THAT(converted.out, HasSubstr(line));
      const auto stats = nlohmann::json::parse(test::read_file(folder_ / "a.json"))["volume"];
      EXPECT_THAT(line, HasSubstr(stats["compression"].get<std::string>()));
      EXPECT_EQ(stats["max_voxel_error"].is_null(), line.find("max error") == std::string::npos);
      EXPECT_GT(stats["rate"], 0);
    }
  }
  ASSERT_EQ(run_isowave("convert " + quoted(kFuel) + " -o " + quoted(folder_ / "a.zfp")).status, 0);
  const ProgramResult from_file =
      run_isowave("extract --device cpu -i 80 -o " + quoted(folder_ / "a.ply") + " " +
                  quoted(folder_ / "a.zfp"));
  EXPECT_EQ(from_file.out.find("compressed in memory"), std::string::npos);
}

// 0.7 has no float32: the nearest, which the voxel has, is below.
TEST_F(CliExtract, AnIsovalueIsComparedAsItWasGiven) {
  std::vector<float> voxels(5 * 5 * 5);
  voxels[62] = 0.7f;
  const std::filesystem::path file = folder_ / "a_5x5x5_float32.raw";
  test::write_file(file, voxels);
  for (const auto &[isovalue, triangles] :
       {std::pair("0.7", "0 triangles"), {"0.69999998", "8 triangles"}}) {
    const ProgramResult result =
        run_isowave("extract " + quoted(file) + " -i " + isovalue + " --stats " +
                    quoted(folder_ / "a.json") + " -o " + quoted(folder_ / "a.ply"));
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr(std::string("isovalue ") + isovalue + ": "));
    EXPECT_THAT(result.out, HasSubstr(triangles));
    EXPECT_EQ(nlohmann::json::parse(read_file(folder_ / "a.json"))["isovalue"],
              std::stod(isovalue));
  }
}

TEST_F(CliExtract, ValuesThatARateMakes0AreRefused) {
  std::vector<float> voxels(5 * 5 * 5);
  voxels[62] = 1e-31f;
  const std::filesystem::path file = folder_ / "a_5x5x5_float32.raw";
  test::write_file(file, voxels);
  const std::string rest = quoted(file) + " -i 5e-32 -o " + quoted(folder_ / "a.ply");
  const ProgramResult result = run_isowave("extract --rate 32 " + rest);
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("have all become 0 at a rate or by a tolerance"));
  EXPECT_THAT(run_isowave("extract " + rest).out, HasSubstr("8 triangles"));
}

TEST_F(CliExtract, WrongInputIsOneLine) {
  const std::string fuel = "extract " + quoted(kFuel);
  const std::string ply = " -o " + quoted(folder_ / "a.ply");
  expect_one_line_error(fuel + " -i nan" + ply, "nan");
  expect_one_line_error(fuel + " -i 10 -o " + quoted(folder_ / "a.off"), "end the name in");
  expect_one_line_error(fuel + " -i 10 -o " + quoted(folder_ / "none" / "a.ply"), "none");
  expect_one_line_error(fuel + " -i 10 --normals cell" + ply, "cell");
  for (const auto &[arguments, text] :
       {std::pair(" --level 9", "--level 9"),
        {" --memory-budget 10kB", "a memory budget of 10000 bytes is too small"},
        {" --cache-slots 9", "a block of the surface needs 17"},
        {" --closed --vertices exact", "leave out exact vertices"}}) {
    const ProgramResult result = run_isowave(fuel + " -i 10" + arguments + ply);
    EXPECT_EQ(result.status, 1) << arguments;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_THAT(result.err, HasSubstr(text));
  }
  const ProgramResult missing = run_isowave("extract missing_4x4x4_uint8.raw -i 10" + ply);
  EXPECT_EQ(missing.status, 1);
  EXPECT_THAT(missing.err, HasSubstr("missing_4x4x4_uint8.raw"));
  EXPECT_EQ(folder_.num_files(), 0u) << "something was left behind";
}

}  // namespace
}  // namespace isowave::core
