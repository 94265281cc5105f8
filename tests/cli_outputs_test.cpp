// Files that the program writes, run as a user runs it: none takes the place of an input or of
// another output, names of any length and links work, and what cannot be written is said before any
// work.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

namespace fs = std::filesystem;
using test::expect_one_line_error;
using test::quoted;
using test::read_file;
using test::run_isowave;
using test::TemporaryFolder;
using test::write_file;

/// A folder with a raw volume, the same compressed, and a camera file.
class CliOutputs : public testing::Test {
 protected:
  CliOutputs() {
    std::string voxels(512, '\0');
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = char(i % 8 * 16);
    write_file(folder_ / "v_8x8x8_uint8.raw", voxels);
    write_file(folder_ / "cam.json",
               R"({"width":16,"height":12,"fovy_deg":50,
            "cameras":[{"eye":[4,5,30],"at":[4,4,4],"up":[0,1,0]}]})");
    EXPECT_EQ(run_isowave("convert " + raw() + " -o " + name("v.zfp")).status, 0);
  }
  std::string name(const std::string &file) const { return quoted(folder_ / file); }
  std::string raw() const { return name("v_8x8x8_uint8.raw"); }
  std::string render(const std::string &volume) const {
    return "render " + volume + " -i 40 --size 16x12 --reference ";
  }

  /// The command is refused, and every file is as it was.
  void expect_refused(const std::string &arguments, std::string_view text) {
    std::map<fs::path, std::string> before;
    for (const auto &entry : fs::directory_iterator(folder_.path()))
      before[entry.path()] = is_file(entry.path()) ? read_file(entry.path()) : "";
    expect_one_line_error(arguments, text);
    EXPECT_EQ(folder_.num_files(), before.size()) << arguments;
    for (const auto &[path, bytes] : before) {
      if (!is_file(path)) continue;
      EXPECT_EQ(read_file(path), bytes) << arguments << "\n" << path;
    }
  }

  static bool is_file(const fs::path &path) {
    std::error_code failure;  // of links in circles
    return fs::is_regular_file(path, failure);
  }

  TemporaryFolder folder_;
};

TEST_F(CliOutputs, NeverTakeTheInputsPlace) {
  for (const char *option : {"-o ", "--depth ", "--stats "}) {
    expect_refused(render(name("v.zfp")) + option + name("v.zfp"), "v.zfp");
    expect_refused(render(raw()) + option + raw(), "take the place of the input");
    expect_refused(
        render(raw()) + "--cameras " + name("cam.json") + " " + option + name("cam.json"),
        "cam.json");
    expect_refused(render(raw()) + option +
                       name("./../" + folder_.path().filename().string() + "/v_8x8x8_uint8.raw"),
                   "the input");
  }
  fs::create_symlink("v_8x8x8_uint8.raw", folder_ / "link.zfp");
  fs::create_hard_link(folder_ / "v_8x8x8_uint8.raw", folder_ / "hard.zfp");
  for (const char *other : {"link.zfp", "hard.zfp"}) {
    expect_refused("convert " + raw() + " -o " + name(other), "take the place of the input");
    expect_refused(render(raw()) + "-o " + name(other), "take the place of the input");
  }
  expect_refused("verify " + raw() + " -i 40 --size 16x12 --json " + raw(),
                 "take the place of the input");
  expect_refused(
      "verify " + raw() + " -i 40 --cameras " + name("cam.json") + " --json " + name("cam.json"),
      "cam.json");
  expect_refused("bench solvers " + name("v.zfp") + ":40 --json " + name("v.zfp"),
                 "take the place of the input");
  expect_refused("bench pareto " + raw() + " -i 40 --json " + raw(), "take the place of the input");
}

TEST_F(CliOutputs, NeverTakeThePlaceOfDetachedVoxels) {
  write_file(folder_ / "v.nhdr",
             std::string_view("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 8 8 8\nencoding: raw\n"
                              "data file: v_8x8x8_uint8.raw\n"));
  write_file(
      folder_ / "v.mhd",
      std::string_view("ObjectType = Image\nNDims = 3\nDimSize = 8 8 8\nElementType = MET_UCHAR\n"
                       "ElementDataFile = v_8x8x8_uint8.raw\n"));
  // What only looks like the end of a header, or like the name, is for the reader of headers to
  // tell.
  write_file(
      folder_ / "pairs.nhdr",
      std::string_view(
          "NRRD0004\ndatafile:=none\ntype: uint8\ndimension: 3\nsizes: 8 8 8\nencoding: raw\n"
          "data file: v_8x8x8_uint8.raw\n"));
  write_file(
      folder_ / "blank.mhd",
      std::string_view("ObjectType = Image\nNDims = 3\n\ndatafile = none\nDimSize = 8 8 8\n\n"
                       "ElementType = MET_UCHAR\nElementDataFile = v_8x8x8_uint8.raw\n"));
  std::string comments = "NRRD0004\n";
  while (comments.size() < (1u << 20)) comments += "#" + std::string(1000, 'x') + "\n";
  write_file(
      folder_ / "long.nhdr",
      comments +
          "type: uint8\ndimension: 3\nsizes: 8 8 8\nencoding: raw\ndata file: v_8x8x8_uint8.raw\n");
  for (const char *header : {"v.nhdr", "v.mhd", "pairs.nhdr", "blank.mhd", "long.nhdr"}) {
    ASSERT_EQ(run_isowave("info " + name(header)).status, 0) << "else this proves nothing";
    expect_refused(render(name(header)) + "--depth " + raw(), "take the place of the input");
    expect_refused(render(name(header)) + "--depth " + name(header), "take the place of the input");
  }
}

TEST_F(CliOutputs, NeverTakeEachOthersPlace) {
  const std::string one = name("a.png");
  expect_refused(render(raw()) + "-o " + one + " --depth " + one, "--output");
  expect_refused(render(raw()) + "-o " + one + " --stats " + name("./a.png"), "take the place of");
  expect_refused(render(raw()) + "--depth " + one + " --stats " + one, "take the place of");
  expect_refused(render(raw()) + "-i 40 -o " + one, "take the place of");
  expect_refused(render(raw()) + "-i 41 -o " + one + " --stats " + name("a_iso41_view0.png"),
                 "--stats");
  expect_refused("render " + raw() + " -i 40 --time-budget 9 -o " + one + " --refined " + one,
                 "take the place of");
  fs::create_directory(folder_ / "p");
  expect_refused(
      "render " + raw() + " -i 40 --progress-dir " + name("p") + " -o " + name("p/pass0001.png"),
      "--progress-dir");
  for (const char *inside : {"new", "new/", "new/er"})
    expect_refused(
        "render " + raw() + " -i 40 --progress-dir " + name(inside) + " -o " + name("new"),
        "--progress-dir");
  fs::create_symlink("b", folder_ / "l1");
  fs::create_symlink("b", folder_ / "l2");
  expect_refused(render(raw()) + "--depth " + name("l1") + " --stats " + name("l2"),
                 "take the place of");
  EXPECT_EQ(run_isowave(render(raw()) + "-i 41 -o " + one + " --depth " + name("a.npy")).status, 0);
}

TEST_F(CliOutputs, AreNoStandardOutput) {
  const std::string in_folder = "cd " + name("") + " && " + test::isowave_program() + " ";
  for (const std::string &arguments :
       {render(raw()) + "-o -", render(raw()) + "--depth -", render(raw()) + "--stats -",
        "render " + raw() + " -i 40 --max-surface-error 1 --error-map -",
        "render " + raw() + " -i 40 --time-budget 9 --refined -",
        "render " + raw() + " -i 40 --progress-dir -", "extract " + raw() + " -i 40 -o -",
        "extract " + raw() + " -i 40 -o a.ply --stats -", "convert " + raw() + " -o -",
        std::string("generate gyroid --dims 8 -o -"),
        "verify " + raw() + " -i 40 --size 16x12 --json -",
        "bench solvers " + raw() + ":40 --json -", "bench pareto " + raw() + " -i 40 --json -",
        "bench paper " + raw() + " --json -", "bench paper " + raw() + ":40 --pictures -",
        "bench solvers " + raw() + ":40 --pictures -"}) {
    const std::size_t before = folder_.num_files();
    const auto run = test::run_command(in_folder + arguments);
    EXPECT_EQ(run.status, 1) << arguments;
    EXPECT_EQ(run.out, "") << arguments;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << arguments << run.err;
    EXPECT_TRUE(run.err.starts_with("isowave: ")) << run.err;
    EXPECT_EQ(folder_.num_files(), before) << arguments;
  }
}

TEST_F(CliOutputs, HaveNamesThatFitWhatIsInThem) {
  for (const char *ending : {"jpg", "JPEG", "npy", "tif", "bmp", "pngx", "1"}) {
    const std::string file = name("a." + std::string(ending));
    expect_refused(render(raw()) + "-o " + file,
                   "pictures are written as PNG: end the name in .png");
    expect_refused(render(raw()) + "-i 41 -o " + file, "written as PNG");
    expect_refused("render " + raw() + " -i 40 --time-budget 9 --refined " + file,
                   "written as PNG");
  }
  for (const char *ending : {"png", "npz", "txt"}) {
    const std::string file = name("a." + std::string(ending));
    expect_refused(render(raw()) + "--depth " + file, "end the name in .npy");
    expect_refused("render " + raw() + " -i 40 --max-surface-error 1 --error-map " + file,
                   "end the name in .npy");
  }
  for (const char *ending : {"png", "npy", "csv"}) {
    const std::string file = name("a." + std::string(ending));
    for (const std::string &arguments :
         {render(raw()) + "--stats ",
          "extract " + raw() + " -i 40 -o " + name("a.ply") + " --stats ",
          "verify " + raw() + " -i 40 --size 16x12 --json ",
          "bench solvers " + raw() + ":40 --json ", "bench pareto " + raw() + " -i 40 --json ",
          "bench paper " + raw() + " --json "})
      expect_refused(arguments + file, "end the name in .json");
  }
  expect_refused("extract " + raw() + " -i 40 -o " + name("a.png"), "a.png");
  expect_refused("convert " + raw() + " -o " + name("a.png"), ".zfp");
  for (const std::string &arguments :
       {"-o " + name("a.PNG"), "-o " + name("plain"), "-i 40.5 -o " + name("several"),
        "--stats " + name("a.log"), "--stats " + name("b.json")})
    EXPECT_EQ(run_isowave(render(raw()) + arguments).status, 0) << arguments;
}

TEST_F(CliOutputs, KeepTheModeOfTheFileThatTheyReplace) {
  for (const char *file : {"a.png", "a.npy", "a.json", "v2.zfp", "a.raw"}) {
    write_file(folder_ / file, std::string_view("old"));
    fs::permissions(folder_ / file, fs::perms::owner_read | fs::perms::owner_write);
  }
  for (const std::string &arguments : {render(raw()) + "-o " + name("a.png") + " --depth " +
                                           name("a.npy") + " --stats " + name("a.json"),
                                       "convert " + raw() + " -o " + name("v2.zfp"),
                                       "generate gyroid --dims 8 -o " + name("a.raw")})
    EXPECT_EQ(run_isowave(arguments).status, 0) << arguments;
  for (const char *file : {"a.png", "a.npy", "a.json", "v2.zfp", "a.raw"}) {
    EXPECT_NE(read_file(folder_ / file), "old") << file;
    EXPECT_EQ(fs::status(folder_ / file).permissions(),
              fs::perms::owner_read | fs::perms::owner_write)
        << file;
  }
}

TEST_F(CliOutputs, FilesThatMayNotGrowAreAnErrorLikeOthers) {
  const std::size_t before = folder_.num_files();
  for (const auto &arguments : {"convert generate:gyroid_64x64x64_uint8 -o " + name("a.zfp"),
                                "generate gyroid --dims 64 -o " + name("a.raw"),
                                render(raw()) + "--orbit 1 --stats " + name("a.json")}) {
    const auto result = test::run_command("{ ( ulimit -f 0; " + test::isowave_program() + " " +
                                          arguments + " ) 2>&1; echo status $?; } | cat");
    EXPECT_THAT(result.out, testing::HasSubstr("cannot write")) << arguments;
    EXPECT_THAT(result.out, testing::HasSubstr("status 1")) << arguments;
    EXPECT_EQ(folder_.num_files(), before) << arguments;
  }
}

TEST_F(CliOutputs, ACommandThatFailsLeavesNoneOfItsFiles) {
  test::write_file(folder_ / "old.json", std::string_view("old"));
  const std::size_t before = folder_.num_files();
  const std::string picture = " -o " + name("a.png") + " --depth " + name("a.npy");
  for (const auto &arguments :
       {render(raw()) + "-i 41 --orbit 2" + picture + " --stats " + name("old.json"),
        "render " + raw() + " -i 40 --size 16x12 " + picture + " --progress-dir " + name("new/er"),
        "extract " + raw() + " -i 40 -o " + name("a.ply") + " --stats " + name("old.json"),
        "convert " + raw() + " -o " + name("a.zfp"),
        "generate gyroid --dims 8 -o " + name("a.raw")}) {
    const auto result =
        test::run_command(test::isowave_program() + " " + arguments + " > /dev/full");
    EXPECT_EQ(result.status, 1) << arguments;
    EXPECT_EQ(folder_.num_files(), before) << arguments;
    EXPECT_EQ(test::read_file(folder_ / "old.json"), "old") << arguments;
  }
}

TEST_F(CliOutputs, NamesMayBeAsLongAsTheSystemAllows) {
  const std::string longest(255, 'n'), longer(256, 'n');
  ASSERT_EQ(run_isowave(render(raw()) + "--depth " + name(longest)).status, 0);
  EXPECT_EQ(run_isowave(render(raw()) + "--depth " + name(longest)).status, 0)
      << "also to replace it";
  EXPECT_TRUE(fs::is_regular_file(folder_ / longest));
  expect_refused(render(raw()) + "--depth " + name(longer), "cannot write");
  expect_refused(render(raw()) + "-i 41 --depth " + name(longest), "cannot write");
}

TEST_F(CliOutputs, LinksAreFollowed) {
  fs::create_symlink("new.npy", folder_ / "dangling");
  ASSERT_EQ(run_isowave(render(raw()) + "--depth " + name("dangling")).status, 0);
  EXPECT_TRUE(fs::is_symlink(folder_ / "dangling"));
  EXPECT_TRUE(fs::is_regular_file(folder_ / "new.npy"));
  fs::create_symlink("circle", folder_ / "circle");
  expect_refused(render(raw()) + "--depth " + name("circle"), "cannot write");
  fs::create_symlink("missing/new.npy", folder_ / "nowhere");
  expect_refused(render(raw()) + "--depth " + name("nowhere"), "cannot write");
}

TEST_F(CliOutputs, WhatCannotBeWrittenIsSaidBeforeAnyWork) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  const std::string inputs = "none_8x8x8_uint8.raw -i 1 ";  // looked at later
  expect_one_line_error("render " + inputs + "-o " + name("pipe"), "not a regular file");
  expect_one_line_error("render " + inputs + "-o /dev/full", "not a regular file");
  expect_one_line_error("render " + inputs + "--stats " + quoted(folder_.path()),
                        "not a regular file");
  expect_one_line_error("verify " + inputs + "--json " + name("missing/a"), "cannot write");
  expect_one_line_error("bench pareto " + inputs + "--json " + name("pipe"), "not a regular file");
  expect_one_line_error("bench solvers none.raw:1 --json " + name("pipe"), "not a regular file");
  expect_one_line_error("convert none_8x8x8_uint8.raw -o " + name("missing/a.zfp"), "cannot write");
  // Within a limit, so that a program which does not look first cannot fill the disk.
  const auto too_large = test::run_command("ulimit -f 64; " + test::isowave_program() +
                                           " generate sphere --dims 65536 -o " + name("a.raw"));
  EXPECT_EQ(too_large.status, 1);
  EXPECT_NE(too_large.err.find("are free"), std::string::npos) << too_large.err;
  if (::geteuid() == 0) return;  // may write anywhere
  fs::permissions(folder_ / "v.zfp", fs::perms::owner_read);
  expect_refused(render(raw()) + "--depth " + name("v.zfp"), "cannot write");
}

}  // namespace
}  // namespace isowave::core
