// Voxels in several files, which headers of NRRD and MetaImage list or name by a pattern: read to
// the byte, and refused in one line.

#include "core/io/voxel_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.hpp"
#include "tests/run_program.hpp"
#include "tests/volume_headers.hpp"

namespace isowave::core {
namespace {

using test::error_of;
using test::expect_ramp;
using test::gzip;
using test::meta_image;
using test::ramp;
using test::write_file;
using testing::HasSubstr;

std::string listed_nrrd(const std::string &lines, const std::string &sizes = "3 4 5",
                        const std::string &encoding = "raw") {
  const auto axes = 1 + std::ranges::count(sizes, ' ');
  return fmt::format("NRRD0004\ntype: uint8\ndimension: {}\nsizes: {}\nencoding: {}\n{}", axes,
                     sizes, encoding, lines);
}

/// The ramp of 60 voxels in files of `size` each: NAME_0.raw, NAME_1.raw ...
class VoxelFilesOf : public test::Headers {
 protected:
  std::string put(const std::string &name, std::size_t size, const std::string &bytes = ramp()) {
    std::string names;
    for (std::size_t i = 0; i * size < bytes.size(); ++i) {
      const std::string file = fmt::format("{}_{}.raw", name, i);
      write_file(folder_ / file, bytes.substr(i * size, size));
      names += file + "\n";
    }
    return names;
  }
};

TEST_F(VoxelFilesOf, EachWithSomeOfTheAxes) {
  const std::string layers = put("layer", 12), rows = put("row", 3), all = put("all", 60);
  const std::string voxels = put("voxel", 1);
  put("thick", 60);
  expect_read("a.nhdr", listed_nrrd("data file: LIST\n" + layers));
  expect_read("a.nhdr", listed_nrrd("data file: LIST 2\n" + layers));
  expect_read("a.nhdr", listed_nrrd("data file: LIST 3\n" + layers));  // parts of the last axis
  expect_read("a.nhdr", listed_nrrd("data file: LIST 3\n" + all));
  expect_read("a.nhdr", listed_nrrd("data file: LIST 1\n" + rows));
  expect_read("a.nhdr", listed_nrrd("datafile:  LIST \t3\r\nall_0.raw\r\n"));
  expect_read(
      "a.nhdr",
      listed_nrrd("kinds: vector domain domain domain\ndata file: LIST 1\n" + voxels, "1 3 4 5"));
  expect_read("a.nhdr", listed_nrrd("data file: LIST\n" + layers + "\nno name"));
  expect_read("a.nhdr", listed_nrrd("data file: layer_%d.raw 0 4 1\n"));
  expect_read("a.nhdr", listed_nrrd("data file: row_%d.raw 0 19 1 1\n"));
  expect_read("a.nhdr", listed_nrrd("data file: ./layer_%d.raw 0 4 1 3\n"));
  std::string meta = meta_image("");
  meta.resize(meta.size() - 6);
  expect_read("a.mhd", meta + "LIST\n" + layers);
  expect_read("a.mhd", meta + "LIST 2\n" + layers);
  expect_read("a.mhd", meta + "layer_%d.raw 0 4 1\n");
}

TEST_F(VoxelFilesOf, PatternsCountAsPrintfDoes) {
  const std::string bytes = ramp();
  for (const auto &[pattern, names] :
       {std::pair{"s%03d.raw 8 12 1",
                  std::vector{"s008.raw", "s009.raw", "s010.raw", "s011.raw", "s012.raw"}},
        {"s%3d 8 16 2", {"s  8", "s 10", "s 12", "s 14", "s 16"}},
        {"s%d.raw 2 -2 -1", {"s2.raw", "s1.raw", "s0.raw", "s-1.raw", "s-2.raw"}},
        {"a b%02d 1 10 2", {"a b01", "a b03", "a b05", "a b07", "a b09"}},
        {"s%04d -2 2 1", {"s-002", "s-001", "s0000", "s0001", "s0002"}}}) {
    for (std::size_t i = 0; i < names.size(); ++i)
      write_file(folder_ / names[i], bytes.substr(12 * i, 12));
    expect_read("a.nhdr", listed_nrrd(fmt::format("data file: {}\n", pattern)));
    for (const char *name : names) std::filesystem::remove(folder_ / name);
  }
}

TEST_F(VoxelFilesOf, PackedOnesAndBytesBefore) {
  const std::string bytes = ramp();
  for (std::size_t i = 0; i < 5; ++i) {
    const std::string layer = bytes.substr(12 * i, 12);
    std::string hex;
    for (const char c : layer) hex += fmt::format("{:02x}", static_cast<unsigned char>(c));
    write_file(folder_ / fmt::format("g{}", i), gzip("xy" + layer));
    write_file(folder_ / fmt::format("x{}", i), hex);
    write_file(folder_ / fmt::format("s{}", i), fmt::format("a line of {}\nxy{}", i, layer));
    write_file(folder_ / fmt::format("e{}", i), std::string(i, '.') + layer);
  }
  expect_read("a.nhdr", listed_nrrd("byte skip: 2\ndata file: g%d 0 4 1\n", "3 4 5", "gzip"));
  expect_read("a.nhdr", listed_nrrd("data file: x%d 0 4 1\n", "3 4 5", "hex"));
  expect_read("a.nhdr", listed_nrrd("line skip: 1\nbyte skip: 2\ndata file: s%d 0 4 1\n"));
  expect_read("a.nhdr", listed_nrrd("byte skip: -1\ndata file: e%d 0 4 1\n"));
}

TEST_F(VoxelFilesOf, SeriesHaveStepsInAnyNumberOfFiles) {
  std::string bytes = ramp();
  for (int i = 0; i < 60; ++i) bytes += static_cast<char>(100 + i);
  for (const auto &[size, axes] : {std::pair{12, 2}, {60, 3}, {3, 1}, {120, 4}, {60, 4}}) {
    SCOPED_TRACE(size);
    const std::string list = fmt::format("data file: LIST {}\n", axes) +
                             put("step", static_cast<std::size_t>(size), bytes);
    write_file(folder_ / "a.nhdr", listed_nrrd(list, "3 4 5 2"));
    EXPECT_EQ(num_steps(folder_ / "a.nhdr"), 2u);
    expect_ramp(*open_volume(folder_ / "a.nhdr", {}, 0));
    std::vector<float> expected(60);
    std::iota(expected.begin(), expected.end(), 100.0f);
    EXPECT_EQ(test::read_all(*open_volume(folder_ / "a.nhdr", {}, 1)), expected);
    EXPECT_EQ(test::read_all(*open_volume(folder_ / "a.nhdr", {.step = 1})), expected);
  }
}

TEST_F(VoxelFilesOf, AreRefusedInOneLine) {
  const std::string layers = put("layer", 12);
  const auto refused = [&](const std::string &field, const std::string &text) {
    expect_refused("a.nhdr", listed_nrrd("data file: " + field + "\n"), text);
  };
  refused("layer_%d.raw 1 5 1", "a.nhdr: its data file 'layer_5.raw': no such file");
  refused("layer_%d.raw 0 3 1", "data file: 4 files, need 5");
  refused("layer_%d.raw 0 4 1 1", "data file: 5 files, need 20");
  refused("layer_%d.raw 0 3 1 3", "data file: 4 files, which cannot share an axis of 5");
  refused("layer_%d.raw 0 4 1 0", "data file: files with 0 axes, of an array with 3");
  refused("layer_%d.raw 0 4 1 4", "files with 4 axes");
  refused("layer_%d.raw 0 4 1 x", "'x' is no number of axes");
  refused("layer_%d.raw 0 4 0", "its step does not lead from the first number to the last");
  refused("layer_%d.raw 4 0 1", "its step does not lead");
  refused("layer_%d.raw 0 4 -1", "its step does not lead");
  refused("layer_%d.raw 0 9999999999 1", "9999999999 is too large");
  refused("layer_%d.raw 0 4 1.5", "'1.5' is no whole number");
  refused("layer_%d.raw 0 4", "need a pattern and its first number, last number and step");
  refused("layer_%d.raw", "need a pattern and its first number");
  refused("layer_%d_%d.raw 0 4 1", "need one %d");
  refused("layer_%099d.raw 0 4 1", "099 digits are too many");
  refused("layer_%d.raw 0 2147483647 1", "2147483648 files, need 5");
  refused("LIST", "no names follow it");
  refused("LIST\n\nlayer_0.raw", "no names follow it");
  refused("LIST x\nlayer_0.raw", "'x' is no number of axes");
  refused("LIST 2 3\nlayer_0.raw", "need LIST, or LIST and a number of axes");
  refused("LIST\nlayer_0.raw", "data file: 1 file, need 5");
  refused("LIST\n" + std::string(70000, 'x'), "name 1 is too long");
  std::string names;
  for (int i = 0; i < 1 << 20; ++i) names += "x\n";
  refused("LIST\n" + names + "x", "more than 1048576 names");
  expect_refused("a.nhdr", listed_nrrd("data file: s%d 0 3 1 4\n", "65536 65536 65536 65536"),
                 "more voxels than files have");
  write_file(folder_ / "layer_3.raw", std::string(11, 'x'));
  refused("LIST\n" + layers,
          "its data file 'layer_3.raw': truncated: 3x4x1 uint8 voxels need 12 bytes, found 11");
  write_file(folder_ / "layer_3.raw", std::string(13, 'x'));
  refused("layer_%d.raw 0 4 1", "'layer_3.raw': too long: 3x4x1 uint8 voxels need 12 bytes");
  std::filesystem::remove(folder_ / "layer_3.raw");
  ASSERT_EQ(::mkfifo((folder_ / "layer_3.raw").c_str(), 0600), 0);
  refused("layer_%d.raw 0 4 1", "'layer_3.raw': not a regular file");
  refused("LIST\n\x1b[1m.raw\nb\nc\nd\ne", R"(its data file '\x1b[1m.raw': no such file)");
}

TEST_F(VoxelFilesOf, FilesThatChangeMeanwhileAreOneLine) {
  put("layer", 12);
  write_file(folder_ / "a.nhdr", listed_nrrd("data file: layer_%d.raw 0 4 1\n"));
  const auto error_after = [&](const auto &change) -> std::string {
    put("layer", 12);
    const auto reader = open_volume(folder_ / "a.nhdr");
    change();
    try {
      test::read_all(*reader);
    } catch (const Error &error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(error_after([&] { std::filesystem::remove(folder_ / "layer_4.raw"); }),
              HasSubstr("'layer_4.raw': no such file"));
  EXPECT_THAT(error_after([&] { write_file(folder_ / "layer_4.raw", "short"); }),
              HasSubstr("'layer_4.raw': truncated"));
  for (int i = 0; i < 5; ++i)
    write_file(folder_ / fmt::format("g{}", i), gzip(std::string(i == 4 ? 13 : 12, 'x')));
  expect_refused("a.nhdr", listed_nrrd("data file: g%d 0 4 1\n", "3 4 5", "gzip"),
                 "'g4': too long: 12 bytes of voxels are its share");
}

/// Outputs never take the place of any of the files.
TEST_F(VoxelFilesOf, AreInputsOfTheProgram) {
  put("layer", 12);
  write_file(folder_ / "a.nhdr", listed_nrrd("data file: layer_%d.raw 0 4 1\n"));
  std::filesystem::rename(folder_ / "layer_4.raw", folder_ / "layer_4.zfp");
  std::filesystem::create_symlink("layer_4.zfp", folder_ / "layer_4.raw");
  test::expect_one_line_error("convert " + test::quoted(folder_ / "a.nhdr") + " -o " +
                                  test::quoted(folder_ / "layer_4.zfp"),
                              "it would take the place of the input");
  EXPECT_EQ(std::filesystem::file_size(folder_ / "layer_4.zfp"), 12u);
}

}  // namespace
}  // namespace isowave::core
