// `isowave verify VOLUME`, run as a user runs it: which oracles judge, what is left out, and how it
// fails.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::quoted;
using test::run_isowave;
using test::TemporaryFolder;
using test::write_file;

const std::string kHead = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";

TEST(CliVerify, JudgesFramesByEveryOracle) {
  const TemporaryFolder folder;
  const auto run = run_isowave(fmt::format("verify {} --isovalue 100 --size 64x48 --json '{}'",
                                           kHead, (folder / "v.json").string()));
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  const json document = json::parse(test::read_file(folder / "v.json"));
  std::set<std::string> oracles;
  for (const json &frame : document.at("frames")) {
    oracles.insert(frame.at("oracle"));
    EXPECT_EQ(frame.at("drawn_by"), "scalar reference");
    EXPECT_GT(frame.at("hits"), 100);
    for (const char *count : {"missed", "false", "wrong_cells", "wrong_places"})
      EXPECT_EQ(frame.at(count), 0);
  }
  EXPECT_EQ(oracles, (std::set<std::string>{"cells", "mesh", "roots"}));
}

TEST(CliVerify, JudgesADevicesFramesByTheOraclesAskedFor) {
  const auto run = run_isowave("verify --oracle cells --oracle mesh " + kHead +
                               " --isovalue 100 --size 64x48 --device 0");
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  EXPECT_NE(run.out.find("device 0: "), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("cells, isovalue 100, view 0"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("mesh, isovalue 100, view 0"), std::string::npos) << run.out;
  EXPECT_EQ(run.out.find("roots, isovalue 100, view 0"), std::string::npos) << run.out;
}

TEST(CliVerify, NamesViewsOutOfEmbreesReach) {
  const TemporaryFolder folder;
  write_file(folder / "far.json",
             R"({"dims":[41,41,41],"spacing":[1,1,1],"width":32,"height":24,"fovy_deg":0.05,
    "cameras":[{"eye":[20,20,100000],"at":[20,20,20],"up":[0,1,0]}]})");
  const std::string arguments =
      fmt::format("verify {} --isovalue 100 --cameras '{}'", kHead, (folder / "far.json").string());
  const auto run = run_isowave(arguments);
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  EXPECT_NE(run.out.find("left out: the eye is 100000 voxels"), std::string::npos) << run.out;
  const auto only_cells = run_isowave(arguments + " --oracle cells");
  EXPECT_EQ(only_cells.status, 1) << "nothing was judged";
  EXPECT_NE(only_cells.err.find("no frame"), std::string::npos) << only_cells.err;
}

TEST(CliVerify, JudgesBoundsOfErrors) {
  const TemporaryFolder folder;
  const auto run = run_isowave(
      "verify " + kHead +
      " -i 80 --orbit 2 --size 64x48 --rate 8 --max-surface-error 2 --device cpu --json " +
      quoted(folder / "v.json"));
  EXPECT_EQ(run.status, 0) << run.err;
  const json frames = json::parse(test::read_file(folder / "v.json"))["frames"];
  ASSERT_EQ(frames.size(), 2u);
  for (const json &frame : frames) {
    EXPECT_EQ(frame["exceeded"], 0);
    EXPECT_GT(frame["certified"], 0.9 * frame["pixels"].get<double>());
    EXPECT_GT(frame["misses"], 0);
    EXPECT_GE(frame["slack"]["p50"], 1.0);
  }
  const std::string command = "verify " + kHead + " -i 80 --max-surface-error ";
  test::expect_one_line_error(command + "0", "an error of 0 pixels");
  test::expect_one_line_error(command + "1 --oracle cells", "leave out --oracle");
  test::expect_one_line_error(command + "1 --solver linear", "the default solver");
  test::expect_one_line_error("verify --max-surface-error 1", "give a VOLUME");
  test::expect_one_line_error("verify none.zfp -i 80 --max-surface-error 1",
                              "the volume before compression is needed");
}

TEST(CliVerify, TracesRaysAtClosedSurfacesByTwinAndDevice) {
  const TemporaryFolder folder;
  const auto run =
      run_isowave("verify --solver bernstein --rays 50 --watertight 20000 --device cpu --json " +
                  quoted(folder / "v.json"));
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  const json document = json::parse(test::read_file(folder / "v.json"));
  EXPECT_EQ(document.at("device").at("type"), "cpu");
  std::map<std::string, int> surfaces;
  for (const json &surface : document.at("solvers").at(0).at("watertight")) {
    ++surfaces[surface.at("by")];
    EXPECT_GE(surface.at("rays"), 20000);
    EXPECT_EQ(surface.at("leaks"), 0);
  }
  EXPECT_EQ(surfaces, (std::map<std::string, int>{
                          {"twin", 6}, {"pipeline rays", 6}, {"pipeline blocks", 3}}));
  EXPECT_EQ(run_isowave("verify --rays 50 --watertight 0 --solver bernstein").out.find("device"),
            std::string::npos);
}

/// All layers of the scalar reference, and the first one of a device.
TEST(CliVerify, JudgesLayers) {
  const TemporaryFolder folder;
  const std::string command =
      "verify " + kHead +
      " --size 48x36 --surface 180 --surface 60,,0.0625 --surface 100,bone,0.3 "
      "--clip=-1,0.3,-0.4 --json " +
      quoted(folder / "v.json");
  for (const std::string options : {"", " --no-caps", " --device cpu"}) {
    const auto run = run_isowave(command + options);
    ASSERT_EQ(run.status, 0) << options << "\n" << run.out << run.err;
    const json frame = json::parse(test::read_file(folder / "v.json"))["frames"][0];
    const bool is_whole = options != " --device cpu";
    EXPECT_EQ(frame["judged"], is_whole ? "all" : "first");
    EXPECT_EQ(frame["rays"], 48 * 36);
    EXPECT_EQ(frame["surfaces"][1], json::parse(R"({"isovalue":60.0,"opacity":0.0625})"));
    EXPECT_GT(frame["hits"], 100);
    EXPECT_EQ(frame["caps"] > 10, options != " --no-caps") << frame;
    EXPECT_EQ(frame["most_hits"] > 4, is_whole) << frame;
    EXPECT_LT(frame["undecided"], 5);
    for (const char *failure : {"missed", "false", "wrong_order", "wrong_surfaces", "wrong_sides",
                                "wrong_kinds", "wrong_places", "wrong_gradients"})
      EXPECT_EQ(frame[failure], 0) << failure;
  }
}

TEST(CliVerify, RefusesSurfacesInOneLine) {
  const std::string command = "verify " + kHead + " --size 16x12 --surface ";
  test::expect_one_line_error("verify --surface 100", "--surface: is for frames: give a VOLUME");
  for (const char *value : {"100,", "100,,0.5,1", ",0.5"})
    test::expect_one_line_error(command + value, "give VALUE, VALUE,COLOR, VALUE,COLOR,OPACITY or");
  for (const char *value : {"x", "nan", "1e400"})
    test::expect_one_line_error(command + value, "is no finite number that float32 holds");
  test::expect_one_line_error(command + "100,,0", "an opacity of 0 is out of range");
  test::expect_one_line_error(command + "9 --surface 9", "two surfaces have the isovalue 9");
  test::expect_one_line_error(command + "9 -i 9", "--isovalue: frames of --surface have");
  test::expect_one_line_error(command + "9 --oracle roots", "--oracle: frames of --surface have");
  std::string nine = command + "1";
  for (const char *value : {"2", "3", "4", "5", "6", "7", "8", "9"})
    nine += std::string(" --surface ") + value;
  test::expect_one_line_error(nine, "9 surfaces are more than a frame can have");
}

TEST(CliVerify, JudgesFramesOfTheHost) {
  const auto run =
      run_isowave("verify --oracle roots " + kHead + " --isovalue 100 --size 32x24 --device host");
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  test::expect_one_line_error(
      "verify " + kHead + " -i 9 --oracle roots --device host --solver linear",
      "the host draws by the default solver");
}

TEST(CliVerify, RefusesWhatItCannotDo) {
  test::expect_one_line_error("verify --oracle cells", "give a VOLUME");
  EXPECT_NE(run_isowave("verify " + kHead + " --isovalue 100 --oracle none").status, 0);
}

}  // namespace
}  // namespace isowave::core
