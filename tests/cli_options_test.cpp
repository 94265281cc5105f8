// Options and streams of the program, run as a user runs it: values that mean nothing, options
// without effect, pipes, a standard output that fails, and errors that are one line whatever they
// quote.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "core/base/parallel_for.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

namespace fs = std::filesystem;
using test::expect_one_line_error;
using test::isowave_program;
using test::quoted;
using test::run_command;
using test::run_isowave;
using test::TemporaryFolder;
using test::write_file;

const std::string kHead = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";
const std::string kRender = "render " + kHead + " -i 80 --size 16x12 ";

/// Status 1 and one line that begins with the program's name and says `text`; what was printed
/// before does not matter.
void expect_failure(const test::ProgramResult &result, std::string_view text) {
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_TRUE(result.err.starts_with("isowave: ")) << result.err;
  EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
}

TEST(CliOptions, EmptyValuesAreRefused) {
  for (const char *option : {"-i",
                             "--tolerance",
                             "--tolerance-relative",
                             "--rate",
                             "--levels",
                             "--voxel-error",
                             "--size",
                             "--orbit",
                             "--cameras",
                             "--memory-budget",
                             "--output",
                             "--depth",
                             "--stats",
                             "--device",
                             "--max-surface-error",
                             "--by",
                             "--progress-dir",
                             "--color",
                             "--dims",
                             "--type",
                             "--spacing",
                             "--pipeline",
                             "--solver"}) {
    const std::string name = std::string_view(option) == "-i" ? "--isovalue" : option;
    expect_one_line_error(kRender + option + " ''", name + ": the value is empty");
  }
  expect_one_line_error("render '' -i 80", "VOLUME: the value is empty");
  expect_one_line_error(kRender + "--depth= --stats x", "--depth: the value is empty");
  expect_one_line_error(kRender + "-o --depth x", "a value is missing before --depth");
  expect_one_line_error("bench pareto " + kHead + " -i 80 --ways default,,BCMC", "is empty");
  expect_one_line_error("compare '' ''", "the value is empty");
}

TEST(CliOptions, UnexpectedArgumentsAreNamedInTheirOrder) {
  expect_one_line_error(kRender + "--upwards 0 0 1", "unexpected arguments --upwards 0 0 1: see");
  expect_one_line_error("man page", "unexpected argument page: see --help");
  // A shell makes several files of a pattern.
  const std::string file = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";
  expect_one_line_error(kRender + file, ": put the pattern of a series in quotes: 'run_*.nrrd'");
  expect_one_line_error("info " + file + " " + file, ": see --help");
}

TEST(CliOptions, OnePassIsNamedSo) {
  const TemporaryFolder folder;
  const auto run = run_isowave("render " + kHead + " -i 1000 --size 8x8 --device cpu -o " +
                               quoted(folder / "a.png"));
  EXPECT_NE(run.out.find(" 0 rays hit, 1 pass, "), std::string::npos) << run.out << run.err;
}

TEST(CliOptions, OneRayIsNamedSo) {
  const TemporaryFolder folder;
  const auto run = run_isowave("render " + kHead +
                               " -i 80 --size 1x1 --device host --max-surface-error 0.5 -o " +
                               quoted(folder / "a.png"));
  EXPECT_NE(run.out.find(", view 0: 1 ray hits, "), std::string::npos) << run.out << run.err;
  EXPECT_NE(run.out.find(" % of 1 ray (bound: "), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("\n  at full detail; chosen in "), std::string::npos) << run.out;
}

TEST(CliOptions, NumbersAreDecimalFiniteAndInRange) {
  for (const char *value : {"-1", "0", "GB", "18446744073709551616", "1e30GB", "99999999999EB",
                            "-1GB", "1.5GB", "1XB", " 1GB "})
    expect_one_line_error(kRender + "--memory-budget '" + value + "'", "--memory-budget: ");
  for (const char *value : {"inf", "-inf", "nan", "1e39", "1e400", "0x10", "1,5", "80x", " 80"})
    expect_one_line_error("render " + kHead + " -i '" + value + "'", "--isovalue: ");
  for (const char *value : {"-1", "18446744073709551616", "1e3", "0x10", "+1", "1.0"})
    expect_one_line_error("generate mixing_layer --dims 8 --seed '" + std::string(value) + "'",
                          "--seed: ");
  for (const char *option : {"--voxel-error", "--voxel-pixels", "--max-surface-error",
                             "--time-budget", "--tolerance", "--spacing"})
    expect_one_line_error(kRender + option + " inf", option);
  for (const char *value : {"0", "-1"}) {
    expect_one_line_error("convert " + kHead + " -o a.zfp --tolerance " + value,
                          std::string("a tolerance of ") + value + ": must be above 0");
    expect_one_line_error("convert " + kHead + " -o a.zfp --tolerance-relative " + value,
                          std::string("a relative tolerance of ") + value + ": must be above 0");
  }
  expect_one_line_error("convert " + kHead + " -o a.zfp --tolerance-relative 1e308",
                        "a relative tolerance of 1e+308");
  expect_one_line_error(kRender + "--levels 0", "--levels: ");
  expect_one_line_error(kRender + "--levels -1", "--levels: ");
  expect_one_line_error(kRender + "--orbit 99999999999", "--orbit");
  expect_one_line_error("verify --rays 0", "--rays");
  expect_one_line_error("verify --watertight 0", "--watertight");
  expect_one_line_error("convert " + kHead + " --map-nan 1e39 -o a.zfp", "--map-nan");
  expect_one_line_error("bench pareto " + kHead + " -i 80 --ways rate", "--ways");
  expect_one_line_error("bench solvers " + kHead + ":1e39", "VOLUME:ISOVALUE");
  const TemporaryFolder folder;
  ASSERT_EQ(run_isowave("generate sphere --dims 010 -o " + quoted(folder.path())).status, 0);
  EXPECT_TRUE(fs::exists(folder / "sphere_10x10x10_uint8.raw")) << "decimal, not octal";
}

TEST(CliOptions, SpacingsAndPlacesThatFloatsCannotHoldAreRefused) {
  expect_failure(run_isowave(kRender + "--spacing 1e-300"), "spacing 1e-300");
  expect_failure(run_isowave(kRender + "--spacing 1e300"), "spacing 1e+300");
  expect_failure(run_isowave(kRender + "--spacing 1e-31"), "float32");
  expect_failure(run_isowave(kRender + "--spacing 1e31"), "float32");
  expect_failure(run_isowave(kRender + "--spacing 1 1 1e11"), "float32");
  const TemporaryFolder folder;
  const std::string zfp = quoted(folder / "n.zfp");
  ASSERT_EQ(run_isowave("convert " + kHead + " -o " + zfp).status, 0);
  for (const std::string &volume : {kHead, zfp}) {
    for (const char *spacing : {"0", "-1", "1 1 0"})
      expect_one_line_error("info " + volume + " --spacing " + spacing,
                            "each must be finite and above 0");
  }
  write_file(
      folder / "far.nhdr",
      std::string_view("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 8 8 8\nencoding: raw\nspace: "
                       "left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
                       "space origin: (1e15,0,0)\ndata file: v.raw\n"));
  write_file(folder / "v.raw", std::string(512, '\x20'));
  const auto far =
      run_isowave("render " + quoted(folder / "far.nhdr") + " -i 1 --reference --size 8x8");
  expect_failure(far, "cannot tell voxels apart");
  const auto camera = [&](const std::string &eye, const std::string &up) {
    write_file(folder / "c.json", R"({"width":8,"height":8,"fovy_deg":50,"cameras":[{"eye":)" +
                                      eye + R"(,"at":[0,0,0],"up":)" + up + "}]}");
    return run_isowave("render " + kHead + " -i 1 --reference --cameras " +
                       quoted(folder / "c.json"));
  };
  expect_failure(camera("[1e160,0,0]", "[0,1,0]"), "too large");
  expect_failure(camera("[1e-160,0,0]", "[0,1,0]"), "the same point");
  expect_failure(camera("[1e8,0,0]", "[0,1,0]"), "1e7");
  expect_failure(camera("[1e400,0,0]", "[0,1,0]"), "too large");
  const std::string picture = " -o " + quoted(folder / "p.png");
  EXPECT_EQ(run_isowave(kRender + "--spacing 1e-30 --reference" + picture).status, 0);
  EXPECT_EQ(run_isowave(kRender + "--spacing 1e30 --reference" + picture).status, 0);
}

TEST(CliOptions, OptionsWithoutEffectAreRefused) {
  const TemporaryFolder folder;
  const std::string zfp = quoted(folder / "n.zfp");
  ASSERT_EQ(run_isowave("convert " + kHead + " --rate 1 -o " + zfp).status, 0);
  for (const char *option :
       {"--exact", "--rate 8", "--tolerance 1", "--tolerance-relative 0.1", "--levels 1"}) {
    const std::string name = std::string(option).substr(0, std::string(option).find(' '));
    expect_failure(run_isowave("render " + zfp + " -i 80 --size 8x8 --reference " + option),
                   name + ": ");
    if (name != "--levels")
      expect_failure(run_isowave("verify " + zfp + " -i 80 --size 8x8 " + option), name + ": ");
  }
  expect_one_line_error("bench solvers " + zfp + ":80 --rate 8", "--rate: ");
  expect_one_line_error("info " + zfp + " --dims 41", "--dims");
  expect_one_line_error(kRender + "--grouping radix", "--grouping: ");
  expect_one_line_error(kRender + "--pipeline rays --closest scan", "--closest: ");
  expect_one_line_error(kRender + "--speculation off --max-speculation 8", "--max-speculation: ");
  expect_one_line_error(kRender + "--speculation scanned", "give --pipeline blocks");
  expect_one_line_error(kRender + "--speculation scanned --pipeline rays",
                        "give --pipeline blocks");
  expect_one_line_error(kRender + "--color '#102030' --depth a.npy", "--color: ");
  expect_one_line_error("verify --isovalue 80", "give a VOLUME");
  expect_one_line_error("verify " + kHead + " -i 80 --rays 100", "--rays: ");
  expect_one_line_error("verify " + kHead, "give --isovalue");
  expect_one_line_error("verify " + kHead + " -i 80 --levels 2", "--levels: ");
  expect_one_line_error("generate sphere --dims 8 --seed 3", "--seed: ");
  expect_one_line_error("info generate:sphere_8x8x8_uint8:3",
                        "a seed is of noise, and sphere has none");
  expect_one_line_error(kRender + "--no-stage-times", "--no-stage-times: ");
  expect_one_line_error("convert " + kHead + " --exact --no-verify -o " + quoted(folder / "a.zfp"),
                        "--no-verify: ");
}

TEST(CliOptions, PipesAreNotWaitedFor) {
  const TemporaryFolder folder;
  for (const char *name : {"p", "p.zfp", "p_8x8x8_uint8.raw", "p.nrrd"}) {
    ASSERT_EQ(::mkfifo((folder / name).c_str(), 0600), 0);
    const std::string pipe = quoted(folder / name);
    for (const std::string &arguments :
         {"info " + pipe, "render " + pipe + " -i 80",
          "render " + kHead + " -i 80 --cameras " + pipe, "compare " + pipe + " " + pipe,
          "convert " + pipe + " -o " + quoted(folder / "a.zfp")}) {
      const auto result = run_command("timeout 20 " + isowave_program() + " " + arguments);
      EXPECT_EQ(result.status, 1) << arguments;
      EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    }
  }
  expect_one_line_error(kRender + "--cameras /dev/zero", "not a regular file");
}

TEST(CliOptions, AStandardOutputThatFailsIsAnError) {
  const TemporaryFolder folder;
  for (const std::string &arguments :
       {"info " + kHead, "info --json " + kHead, std::string("--help"), std::string("--version"),
        std::string("render --help"), std::string("devices"),
        kRender + "--reference -o " + quoted(folder / "p.png"),
        "generate sphere --dims 8 -o " + quoted(folder / "s.raw"),
        "convert " + kHead + " -o " + quoted(folder / "n.zfp")}) {
    for (const char *where : {" >/dev/full", " >&-"}) {
      SCOPED_TRACE(arguments + where);
      expect_failure(run_command(isowave_program() + " " + arguments + where), "standard output");
    }
  }
  EXPECT_EQ(folder.num_files(), 0u) << "a command that fails leaves none of its outputs";
  const auto no_error_output = run_command(isowave_program() + " info missing.raw 2>&-");
  EXPECT_EQ(no_error_output.status, 1);
  const auto reader_gone = run_command("{ " + isowave_program() + " --help; echo $? >&2; } | true");
  EXPECT_EQ(reader_gone.err.find("terminate"), std::string::npos) << reader_gone.err;
}

TEST(CliOptions, ErrorsAreOneLineWhateverTheyQuote) {
  const TemporaryFolder folder;
  expect_one_line_error("info 'a\nb.raw'", R"(a\nb.raw)");
  expect_one_line_error("info 'a\x1b[2Jb.raw'", R"(a\x1b[2Jb.raw)");
  expect_one_line_error(
      "info 'a\xff"
      "b.raw'",
      R"(a\xffb.raw)");
  expect_one_line_error("'no\nsuch'", R"(no\nsuch)");
  expect_one_line_error(kRender + "--device 'x\ny'", R"(x\ny)");
  write_file(folder / "bad.json", std::string_view("{\"a\":\n\"\xff\"}"));
  const auto camera = run_isowave(kRender + "--cameras " + quoted(folder / "bad.json"));
  expect_failure(camera, "bad.json: not a camera file");
  EXPECT_EQ(camera.err.find("json.exception"), std::string::npos) << camera.err;
}

TEST(CliOptions, NamesThatAreNoUtf8GoIntoJson) {
  const TemporaryFolder folder;
  const std::string name = (folder / "v\xff_8x8x8_uint8.raw").string();
  std::string voxels(512, '\0');
  for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = char(i % 8 * 16);
  write_file(name, voxels);
  const auto info = run_isowave("info --json '" + name + "'");
  EXPECT_EQ(info.status, 0) << info.err;
  EXPECT_EQ(nlohmann::json::parse(info.out)["dims"][0], 8);
  const auto render = run_isowave("render '" + name + "' -i 40 --size 8x8 --reference --stats " +
                                  quoted(folder / "s.json"));
  EXPECT_EQ(render.status, 0) << render.err;
  EXPECT_NO_THROW(nlohmann::json::parse(test::read_file(folder / "s.json")));
}

TEST(CliOptions, OutOfMemoryIsOneLine) {
  const auto result = run_command(
      "ulimit -v 300000; " + isowave_program() + " " +
      "render generate:sphere_1024x1024x1024_uint8 -i 80 --size 16384x16384 --rate 32 --reference");
  EXPECT_EQ(result.status, 1) << result.err;
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_EQ(result.err.find("bad_alloc"), std::string::npos) << result.err;
}

/// Drivers that find no address space are not to be installed once more.
TEST(CliOptions, NoRoomForDriversIsOutOfMemory) {
  const TemporaryFolder folder;
  const std::string volume = "generate:gyroid_8x8x8_uint8 -i 128 ";
  // KiB: a stack for each thread, and less besides than a driver needs.
  const std::uint32_t stacks = thread_count(0) * 8192;
  for (const std::uint32_t room : {200'000u, 250'000u}) {
    const std::string limit = fmt::format("ulimit -v {}; ", room + stacks);
    for (const std::string &arguments :
         {std::string("devices"), "extract " + volume + "-o " + quoted(folder / "a.ply")}) {
      const auto result = run_command(limit + isowave_program() + " " + arguments);
      EXPECT_EQ(result.status, 1) << limit << arguments;
      EXPECT_TRUE(result.err.starts_with("isowave: out of memory: an OpenCL driver")) << result.err;
      EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    }
    const auto reference = run_command(limit + isowave_program() + " render " + volume +
                                       "--size 8x8 --reference -o " + quoted(folder / "a.png"));
    EXPECT_EQ(reference.status, 0) << limit << reference.err;
  }
  EXPECT_EQ(folder.num_files(), 1u);
}

/// A limit on open files stands in for a compiler that fails.
TEST(CliOptions, KernelsThatDoNotBuildAreOneLineAndALog) {
  const TemporaryFolder folder;
  bool failed = false;
  for (int files = 4; files < 10 && !failed; ++files) {
    const auto run = run_command(
        "env OCL_ICD_VENDORS=pocl.icd POCL_CACHE_DIR=" + quoted(folder / "cache") +
        " TMPDIR=" + quoted(folder.path()) + " prlimit --nofile=" + std::to_string(files) + " " +
        isowave_program() + " render generate:gyroid_8x8x8_uint8 -i 128 --size 8x8");
    if (run.err.find("does not build") == std::string::npos) continue;
    failed = true;
    EXPECT_EQ(run.status, 1);
    const std::size_t begin =
        run.err.find("isowave: ");  // clang, within PoCL, counts its errors in a line before
    ASSERT_NE(begin, std::string::npos) << run.err;
    EXPECT_EQ(run.err.find('\n', begin), run.err.size() - 1) << run.err;
    EXPECT_NE(run.err.find("CL_BUILD_PROGRAM_FAILURE", begin), std::string::npos) << run.err;
    const std::string saying = "the compiler's whole log is ";
    const std::size_t at = run.err.find(saying);
    ASSERT_NE(at, std::string::npos) << run.err;
    const std::string log =
        run.err.substr(at + saying.size(), run.err.size() - at - saying.size() - 1);
    EXPECT_TRUE(log.starts_with(folder.path().string())) << log;
    EXPECT_NE(test::read_file(log), "");
  }
  EXPECT_TRUE(failed) << "else this proves nothing";
}

/// As an ordinary user, since root may write everywhere. Compressing needs the kernels that compile
/// the fastest.
TEST(CliOptions, PoclGetsACacheFolderThatWorks) {
  const TemporaryFolder folder, temporary;
  if (run_isowave("devices").out.find("Portable Computing Language") == std::string::npos)
    GTEST_SKIP() << "no PoCL";
  for (const fs::path &path : {folder.path(), temporary.path()})
    fs::permissions(path, fs::perms::all | fs::perms::sticky_bit);
  const fs::path home = folder / "home";
  fs::create_directory(home);
  if (::geteuid() == 0) {
    ASSERT_EQ(::chown(home.c_str(), 65534, 65534), 0);
  }
  write_file(folder / "file", std::string_view(""));
  const std::string as_user =
      ::geteuid() == 0 ? "setpriv --reuid 65534 --regid 65534 --clear-groups " : "";
  const auto compress = [&](const std::string &environment) {
    return run_command(as_user +
                       "env -u XDG_CACHE_HOME -u POCL_CACHE_DIR OCL_ICD_VENDORS=pocl.icd TMPDIR=" +
                       quoted(temporary.path()) + " " + environment + " " + isowave_program() +
                       " convert generate:gyroid_8x8x8_uint8 --rate 4 --device cpu -o " +
                       quoted(folder / "volume.zfp"));
  };
  for (const char *environment :
       {"HOME=/nonexistent", "XDG_CACHE_HOME=/proc/x", "POCL_CACHE_DIR= HOME=/dev/null"}) {
    const auto run = compress(environment);
    EXPECT_EQ(run.status, 0) << environment << run.out << run.err;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_NE(run.err.find("compiled kernels go to " + temporary.path().string()),
              std::string::npos)
        << run.err;
  }
  const auto no_path = run_command(
      "env PATH= POCL_CACHE_DIR=" + quoted(temporary / "new") + " OCL_ICD_VENDORS=pocl.icd " +
      isowave_program() + " convert generate:gyroid_8x8x8_uint8 --rate 4 --device cpu -o " +
      quoted(folder / "of_root.zfp"));
  EXPECT_EQ(no_path.status, 0) << no_path.err;
  const auto given = compress("HOME=" + quoted(home));
  EXPECT_EQ(given.status, 0) << given.err;
  EXPECT_EQ(given.err, "") << "nothing is said where it works as usual";
  expect_failure(compress("POCL_CACHE_DIR=" + quoted(folder / "file")),
                 "set POCL_CACHE_DIR to another folder");
}

/// Another user, 65534, has made folders and files where drivers keep compiled kernels.
class KernelsOfAnotherUser : public testing::Test {
 protected:
  void SetUp() override {
    if (::geteuid() != 0) GTEST_SKIP() << "only root can give files to another user";
    fs::permissions(temporary_.path(), fs::perms::all | fs::perms::sticky_bit);
  }
  void give_away(const fs::path &path) {
    ASSERT_EQ(::lchown(path.c_str(), 65534, 65534), 0);
    if (!fs::is_symlink(path)) fs::permissions(path, fs::perms::all);
  }
  /// A folder in the way of the cache below `cache`.
  fs::path plant(const fs::path &cache) {
    fs::create_directories(cache / "pocl" / "kcache");
    give_away(cache / "pocl");
    give_away(cache / "pocl" / "kcache");
    return cache / "pocl" / "kcache";
  }
  test::ProgramResult compress(const std::string &driver, const std::string &environment) {
    return run_command("env -u HOME -u XDG_CACHE_HOME -u POCL_CACHE_DIR OCL_ICD_VENDORS=" + driver +
                       " TMPDIR=" + quoted(temporary_.path()) + " " + environment + " " +
                       isowave_program() +
                       " convert generate:gyroid_8x8x8_uint8 --rate 4 --device cpu -o " +
                       quoted(folder_ / "volume.zfp"));
  }
  static bool has(const std::string &vendor) {
    return run_command("env OCL_ICD_VENDORS=" + vendor + " " + isowave_program() + " devices")
               .status == 0;
  }
  void expect_kernels_in(const fs::path &own, const std::string &environment,
                         const std::string &reason) {
    const auto run = compress("pocl.icd", environment);
    EXPECT_EQ(run.status, 0) << environment << run.err;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_NE(run.err.find(reason), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("compiled kernels go to " + own.string()), std::string::npos) << run.err;
    EXPECT_FALSE(fs::is_empty(own));
    fs::remove_all(own);
  }

  const TemporaryFolder folder_, temporary_;
};

TEST_F(KernelsOfAnotherUser, AreNotRunByPocl) {
  if (!has("pocl.icd")) GTEST_SKIP() << "no PoCL";
  const fs::path own = temporary_ / "isowave-kernels-0/pocl";
  expect_kernels_in(own, "", "neither HOME nor XDG_CACHE_HOME is set");
  const fs::path planted = plant(folder_ / "planted");
  expect_kernels_in(own, "XDG_CACHE_HOME=" + quoted(folder_ / "planted"),
                    planted.parent_path().string() + " belongs to another user");
  fs::create_symlink(folder_.path(), temporary_ / "link");
  give_away(temporary_ / "link");
  expect_kernels_in(own, "HOME=" + quoted(temporary_ / "link"), "belongs to another user");
  EXPECT_TRUE(fs::is_empty(planted));
  EXPECT_FALSE(fs::exists(folder_ / ".cache"));

  fs::remove_all(own.parent_path());
  fs::create_directory(own.parent_path());
  give_away(own.parent_path());  // other users know isowave's name, too
  const auto fresh = compress("pocl.icd", "");
  EXPECT_EQ(fresh.status, 0) << fresh.err;
  EXPECT_NE(fresh.err.find(own.parent_path().string() + "."), std::string::npos) << fresh.err;
  EXPECT_TRUE(fs::is_empty(own.parent_path()));
}

TEST_F(KernelsOfAnotherUser, AreRefusedWhereTheUserNamesTheFolder) {
  const std::string advice = "to a folder that only you can write to";
  const fs::path planted = plant(folder_ / "planted"), own = folder_ / "own";
  fs::create_directories(own / "AB" / "f");
  write_file(own / "AB" / "f" / "f.so", std::string_view("code"));
  give_away(own / "AB" / "f" / "f.so");
  fs::create_directory(folder_ / "open");
  fs::permissions(folder_ / "open", fs::perms::all);
  for (const auto &[driver, variable] :
       {std::pair("pocl.icd", "POCL_CACHE_DIR"),
        std::pair("rusticl.icd", "RUSTICL_ENABLE=llvmpipe MESA_SHADER_CACHE_DIR")}) {
    if (!has(driver)) continue;
    for (const fs::path &path : {planted, own, folder_ / "open", folder_ / "open" / "new"}) {
      if (path == own && driver != std::string_view("pocl.icd")) continue;
      expect_failure(compress(driver, variable + ("=" + quoted(path))), advice);
    }
  }
  EXPECT_TRUE(fs::is_empty(planted));
}

}  // namespace
}  // namespace isowave::core
