// The program's volume subcommands, run as a user runs them: what they print, and how they fail.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "core/zfp/zfp_stream.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::expect_one_line_error;
using test::quoted;
using test::run_isowave;
using test::TemporaryFolder;
using test::write_file;

const std::string kHead = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";

TEST(Cli, ConvertAndInfo) {
  const TemporaryFolder folder;
  const std::string zfp = quoted(folder / "n.zfp");
  const auto convert = run_isowave("convert " + kHead + " --rate 4 --spacing 1 2 3 -o " + zfp);
  EXPECT_EQ(convert.status, 0) << convert.err;
  EXPECT_EQ(convert.err, "") << "quiet in a pipe";
  EXPECT_EQ(std::count(convert.out.begin(), convert.out.end(), '\n'), 1) << convert.out;
  for (const char *text : {"41x41x41 uint8", "68,921", "4 bits per voxel", "max error"}) {
    EXPECT_NE(convert.out.find(text), std::string::npos) << convert.out;
  }
  const auto info = run_isowave("info --json " + zfp);
  ASSERT_EQ(info.status, 0) << info.err;
  const auto json = nlohmann::json::parse(info.out);
  EXPECT_EQ(json["dims"], (std::array{41, 41, 41}));
  EXPECT_EQ(json["spacing"], (std::array{1, 2, 3}));
  EXPECT_EQ(json["type"], "uint8");
  EXPECT_EQ(json["rate"], 4.0);
  EXPECT_EQ(json["block_count"], 11 * 11 * 11);
  EXPECT_EQ(json["value_range"], (std::array{0, 228}));
  EXPECT_GT(json["max_voxel_error"], 0.0);
  EXPECT_EQ(json["file_bytes"], std::filesystem::file_size(folder / "n.zfp"));

  const auto text = run_isowave("info " + kHead);
  EXPECT_EQ(text.status, 0) << text.err;
  EXPECT_NE(text.out.find("value_range     0.0 228.0"), std::string::npos) << text.out;
  const std::string of_zfp = run_isowave("info " + zfp).out;
  EXPECT_NE(of_zfp.find("\nmax_voxel_error "), std::string::npos) << of_zfp;
  std::istringstream lines(of_zfp);
  for (std::string line; std::getline(lines, line) && !line.starts_with("isovalues");)
    EXPECT_EQ(line.substr(15, 1), " ") << line;
}

TEST(Cli, WhatWasDoneToAHeaderIsOneLine) {
  const TemporaryFolder folder;
  const std::string volume = quoted(folder / "a.nrrd");
  write_file(folder / "a.nrrd",
             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 4 5\nencoding: raw\nspacings: 2 2 2\n"
             "units: \"um\" \"um\" \"um\"\n\n" +
                 std::string(60, 'x'));
  const std::string zfp = " --exact -o " + quoted(folder / "a.zfp");
  for (const std::string &command : {"info " + volume, "convert " + volume + zfp}) {
    const auto result = run_isowave(command);
    EXPECT_EQ(result.status, 0) << command;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_NE(result.err.find("isowave: warning: "), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("converted to millimetres; units: um"), std::string::npos)
        << result.err;
  }
  const auto info = nlohmann::json::parse(run_isowave("info --json " + volume).out);
  EXPECT_EQ(info["spacing"], (std::array{0.002, 0.002, 0.002}));
}

TEST(Cli, ConvertWithinAnError) {
  const TemporaryFolder folder;
  const std::string zfp = quoted(folder / "n.zfp");
  const auto info_of = [&](const std::string &options) {
    const auto convert = run_isowave("convert " + kHead + " " + options + " -o " + zfp);
    EXPECT_EQ(convert.status, 0) << convert.err;
    EXPECT_EQ(convert.err, "") << "quiet in a pipe";
    const auto info = run_isowave("info --json " + zfp);
    EXPECT_EQ(info.status, 0) << info.err;
    return nlohmann::json::parse(info.out);
  };
  const auto absolute = info_of("--tolerance 2.49");
  EXPECT_EQ(absolute["format"], "zfp, fixed accuracy");
  EXPECT_LE(absolute["max_voxel_error"], 2.49);
  EXPECT_GT(absolute["max_voxel_error"], 0.0);
  EXPECT_EQ(absolute["exact"], false);
  EXPECT_EQ(info_of("--tolerance-relative 0.01"), absolute) << "of a range from 0 to 228";
  const auto exact = info_of("--exact");
  EXPECT_EQ(exact["max_voxel_error"], 0.0);
  EXPECT_EQ(exact["exact"], true);
  EXPECT_GT(exact["rate"], absolute["rate"]);
  EXPECT_EQ(info_of(""), exact) << "the default, of integers";
  const auto render =
      run_isowave("render " + zfp + " --isovalue 100 --size 32x24 -o " + quoted(folder / "n.png"));
  EXPECT_EQ(render.status, 0) << render.err;

  const std::string to = " -o " + quoted(folder / "a.zfp");
  expect_one_line_error("convert " + kHead + " --tolerance 0" + to, "above 0");
  expect_one_line_error("convert " + kHead + " --tolerance 1 --exact" + to, "xact");
  expect_one_line_error("convert " + kHead + " --tolerance 1 --rate 8" + to, "rate");
  expect_one_line_error("convert " + kHead + " --exact --device cpu" + to, "fixed rate only");
  expect_one_line_error("convert " + kHead + " --device cpu" + to, "fixed rate only");
  expect_one_line_error("convert generate:sphere_8x8x8_float64 --exact" + to, "float64");
  write_file(folder / "c_4x4x4_uint8.raw", std::string(64, 'x'));
  expect_one_line_error(
      "convert " + quoted(folder / "c_4x4x4_uint8.raw") + " --tolerance-relative 0.1" + to,
      "no range");
  EXPECT_EQ(folder.num_files(), 3u) << "n.zfp, n.png and c";
}

TEST(Cli, ConvertOnADeviceWritesTheSameFile) {
  const TemporaryFolder folder;
  const std::string host = quoted(folder / "host.zfp"), device = quoted(folder / "device.zfp");
  const auto on_host = run_isowave("convert " + kHead + " --rate 5 -o " + host);
  ASSERT_EQ(on_host.status, 0) << on_host.err;
  const auto on_device = run_isowave("convert " + kHead + " --rate 5 --device cpu -o " + device);
  ASSERT_EQ(on_device.status, 0) << on_device.err;
  EXPECT_EQ(on_device.err, "");
  EXPECT_EQ(test::read_file(folder / "device.zfp"), test::read_file(folder / "host.zfp"));
  expect_one_line_error(
      "convert " + kHead + " --rate 5 --device no_such_device -o " + quoted(folder / "a.zfp"),
      "no_such_device");
  EXPECT_EQ(folder.num_files(), 2u);
}

TEST(Cli, GeneratedFilesAndGeneratorsAreTheSameVolume) {
  const TemporaryFolder folder;
  const auto generate =
      run_isowave("generate gyroid --dims 20 21 22 --type uint8 -o " + quoted(folder.path()));
  ASSERT_EQ(generate.status, 0) << generate.err;
  EXPECT_EQ(generate.err, "");
  ASSERT_TRUE(std::filesystem::exists(folder / "gyroid_20x21x22_uint8.raw")) << generate.out;
  ASSERT_EQ(run_isowave("convert " + quoted(folder / "gyroid_20x21x22_uint8.raw") + " -o " +
                        quoted(folder / "a.zfp"))
                .status,
            0);
  ASSERT_EQ(
      run_isowave("convert generate:gyroid_20x21x22_uint8 -o " + quoted(folder / "b.zfp")).status,
      0);
  EXPECT_EQ(test::read_file(folder / "a.zfp"), test::read_file(folder / "b.zfp"));
  EXPECT_EQ(run_isowave("info generate:mixing_layer_20x21x22_uint8:7").status, 0);
}

TEST(Cli, BadInputIsOneLineAndLeavesNothing) {
  const TemporaryFolder folder;
  const TemporaryFolder out;
  const std::string to = " -o " + quoted(out / "a.zfp");
  const auto file = [&](const std::string &name, const std::string &bytes) {
    write_file(folder / name, bytes);
    return quoted(folder / name);
  };
  const std::string cube(64, 'x');
  expect_one_line_error("convert " + file("a_4x4x4_uint8.raw", cube.substr(1)) + to,
                        "need 64 bytes, found 63");
  expect_one_line_error("convert " + file("b_4x4x4_uint8.raw", cube + "x") + to,
                        "need 64 bytes, found 65");
  expect_one_line_error("convert " + file("b_4x4x4_uint8.raw.gz", cube) + to, "not a gzip file");
  expect_one_line_error("convert " + file("c.raw", cube) + to, "dims and type");
  expect_one_line_error("convert " + file("d_0x4x4_uint8.raw", cube) + to, "0x4x4");
  expect_one_line_error("convert " + file("e_4x4x4_uint7.raw", cube) + to, "e_4x4x4_uint7.raw");
  expect_one_line_error("convert " + file("f.xyz", cube) + to, "unknown kind");
  expect_one_line_error("convert " + file("g.nrrd", cube) + to, "g.nrrd");
  expect_one_line_error("convert " + file("h.mha", cube) + to, "h.mha");
  expect_one_line_error("convert " + file("i.nii", cube) + to, "i.nii");
  expect_one_line_error("convert " + file("j.nii.gz", cube) + to, "j.nii.gz");
  expect_one_line_error("convert " + quoted(folder / "missing.raw") + to, "no such file");
  expect_one_line_error("convert " + file("k_4x4x4_uint8.raw", cube) + " --rate 40" + to,
                        "1 to 32");
  expect_one_line_error("convert " + quoted(folder / "k_4x4x4_uint8.raw") + " --dims 4 4" + to,
                        "--dims");
  expect_one_line_error("convert " + quoted(folder / "k_4x4x4_uint8.raw") + " --spacing 1 0 1" + to,
                        "spacing 1 0 1");
  expect_one_line_error(
      "convert " + quoted(folder / "k_4x4x4_uint8.raw") + " -o " + quoted(out / "a.raw"), ".zfp");
  expect_one_line_error("convert generate:cube_4x4x4_uint8" + to, "unknown field");
  expect_one_line_error("convert generate:sphere" + to, "FIELD_XxYxZ_TYPE");
  expect_one_line_error("convert", "required");
  expect_one_line_error("generate cube --dims 8" + to, "unknown field");
  expect_one_line_error("generate sphere --dims 8 --type uint12 -o " + quoted(out.path()),
                        "unknown voxel type");
  expect_one_line_error("generate sphere --dims 0 -o " + quoted(out.path()), "0x0x0");
  expect_one_line_error("generate sphere --dims 8 -o " + quoted(out / "a_8x8x9_uint8.raw"),
                        "8x8x9");
  expect_one_line_error("generate sphere --dims x -o " + quoted(out.path()), "--dims");
  EXPECT_EQ(out.num_files(), 0u);

  std::vector<float> voxels(64, 1.0f);
  voxels[21] = INFINITY;
  write_file(folder / "l_4x4x4_float32.raw", voxels);
  expect_one_line_error("convert " + quoted(folder / "l_4x4x4_float32.raw") + to, "x=1, y=1, z=1");
  EXPECT_EQ(out.num_files(), 0u);
  EXPECT_EQ(
      run_isowave("convert " + quoted(folder / "l_4x4x4_float32.raw") + " --map-nan 0" + to).status,
      0);
}

TEST(Cli, DamagedZfpFilesAreOneLine) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_isowave("convert " + kHead + " --rate 1 -o " + quoted(folder / "a.zfp")).status, 0);
  const std::string right = test::read_file(folder / "a.zfp");
  const auto damaged = [&](std::size_t byte) {
    std::string wrong = right;
    wrong[byte] = char(wrong[byte] ^ 16);
    write_file(folder / "b.zfp", wrong);
    return "info " + quoted(folder / "b.zfp");
  };
  expect_one_line_error(damaged(0), "not a zfp file");
  expect_one_line_error(damaged(7), "b.zfp");
  expect_one_line_error(damaged(5000), "checksum of its stream");
  expect_one_line_error(damaged(right.size() - 100), "checksum of its trailer");
  expect_one_line_error(damaged(right.size() - 1), "unknown bytes after the zfp stream");
  write_file(folder / "b.zfp", right.substr(0, 5000));
  expect_one_line_error("info " + quoted(folder / "b.zfp"), "truncated");
  write_file(folder / "b.zfp", std::string_view(""));
  expect_one_line_error("info " + quoted(folder / "b.zfp"), "not a zfp file");
}

TEST(Cli, UnwritableOutputIsOneLine) {
  const TemporaryFolder folder;
  expect_one_line_error("convert " + kHead + " -o " + quoted(folder / "missing" / "a.zfp"),
                        "cannot write");
  std::filesystem::create_directory(folder / "folder.zfp");
  expect_one_line_error("convert " + kHead + " -o " + quoted(folder / "folder.zfp"),
                        "not a regular file");
  expect_one_line_error("generate sphere --dims 8 -o /dev/full", "/dev/full");
  EXPECT_EQ(folder.num_files(), 1u);
}

TEST(Cli, FoldersAreForThePythonPackage) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "layers");
  for (const std::string command : {"render ", "info ", "convert -o a.zfp "})
    expect_one_line_error(command + quoted(folder / "layers"), "folders of TIFF and DICOM");
}

TEST(Cli, FullDiskLeavesNothingAndKeepsTheOldFile) {
  const TemporaryFolder folder;
  write_file(folder / "a.raw", std::string_view("old"));
  // A limit on file size stands in for a full disk; the signal that comes with it must be ignored
  // first.
  const auto result =
      test::run_command("trap '' XFSZ; ulimit -f 64; " + test::isowave_program() +
                        " generate sphere --dims 128 -o " + quoted(folder / "a.raw"));
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_NE(result.err.find("cannot write"), std::string::npos) << result.err;
  EXPECT_EQ(test::read_file(folder / "a.raw"), "old");
  EXPECT_EQ(folder.num_files(), 1u);
}

}  // namespace
}  // namespace isowave::core
