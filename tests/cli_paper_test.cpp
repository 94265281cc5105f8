// isowave bench paper, run as a user runs it: what it measures, and how it fails.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::expect_one_line_error;
using test::ProgramResult;
using test::quoted;
using test::read_file;
using test::run_isowave;
using testing::HasSubstr;

const std::string kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";

class CliPaper : public testing::Test {
 protected:
  json measure(const std::string &arguments) {
    const auto file = folder_ / "paper.json";
    const ProgramResult result =
        run_isowave("bench paper --isovalues 3 --views 2 --size 64x48 --seed 7 --limits 1,64 " +
                    arguments + " --json " + quoted(file));
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(result.err, "");
    out_ = result.out;
    return json::parse(read_file(file));
  }

  test::TemporaryFolder folder_;
  std::string out_;
};

TEST_F(CliPaper, MeasuresAllMethods) {
  const json said =
      measure(kFuel + " --scaling 32x24 --range 20 120 --pictures " + quoted(folder_ / "pictures"));
  ASSERT_EQ(said["volumes"].size(), 1u);
  const json &volume = said["volumes"][0], &methods = volume["methods"];
  for (const json &isovalue : volume["isovalues"]) {
    EXPECT_GE(isovalue, 20);
    EXPECT_LE(isovalue, 120);
  }
  ASSERT_EQ(methods.size(), 11u)
      << "five with rays, two of triangles, three of another size, scanned speculation";
  const json &blocks = methods[0], &without = methods[1], &rays = methods[2], &tight = methods[4],
             &bcmc = methods[5];
  EXPECT_EQ(blocks["method"], "blocks");
  EXPECT_EQ(rays["method"], "rays");
  EXPECT_EQ(bcmc["method"], "bcmc");
  EXPECT_EQ(blocks["new_ms"]["count"], 3);
  EXPECT_EQ(blocks["next_ms"]["count"], 3);
  EXPECT_EQ(tight["cache_slots"], rays["active_blocks"]["max"]);
  EXPECT_LT(tight["device_bytes"], rays["device_bytes"]);
  EXPECT_EQ(methods[7]["size"], json({32, 24}));
  EXPECT_GT(without["passes"]["mean"], blocks["passes"]["mean"]) << "without speculation";
  EXPECT_EQ(without["n_spec"]["max"], 1);
  EXPECT_GE(blocks["visible_blocks"]["mean"], 1);
  EXPECT_TRUE(rays["visible_blocks"].is_null());
  const json &scanned = methods[10];
  EXPECT_EQ(scanned["look_ahead"], "scanned");
  EXPECT_EQ(blocks["look_ahead"], "global");
  EXPECT_EQ(rays["look_ahead"], "per-ray");
  EXPECT_GE(scanned["n_spec"]["mean"], blocks["n_spec"]["mean"]);
  ASSERT_EQ(volume["limits"].size(), 3u);
  for (const json &method : volume["limits"]) {
    const json &least = method["by_limit"][0], &most = method["by_limit"][1];
    EXPECT_EQ(least["limit"], 1);
    EXPECT_GT(least["passes"]["mean"], most["passes"]["mean"]);
    EXPECT_LE(least["active_blocks"]["mean"], most["active_blocks"]["mean"]);
  }
  for (const json *method : {&blocks, &without, &rays, &tight, &scanned}) {
    EXPECT_GT((*method)["touched_blocks"]["max"], 0);
    EXPECT_LE((*method)["touched_blocks"]["max"], (*method)["active_blocks"]["max"]);
    const json &completed = (*method)["completed_percent"];
    EXPECT_TRUE(std::ranges::is_sorted(completed));
    EXPECT_DOUBLE_EQ(completed.back().get<double>(), 100);
    EXPECT_TRUE(std::ranges::is_sorted((*method)["progress"]["ms"]));
    EXPECT_LE((*method)["active_blocks"]["max"], volume["blocks"]);
    EXPECT_LT((*method)["cache_bytes"], (*method)["device_bytes"]);
  }
  EXPECT_TRUE(bcmc["refused"].is_null());
  EXPECT_GT(bcmc["triangles"]["min"], 100);
  EXPECT_GE(bcmc["active_blocks"]["mean"], bcmc["listed_blocks"]["mean"]);
  EXPECT_GE(bcmc["cache_slots"], bcmc["active_blocks"]["max"]);
  EXPECT_GT(volume["agreement"]["percent"], 95);
  EXPECT_GT(volume["agreement"]["hits_percent"], 1);
  for (const char *kind : {"rays", "bcmc"})
    EXPECT_GT(
        std::filesystem::file_size(folder_ / "pictures" /
                                   ("paper_fuel_64x33x32_uint8_" + std::string(kind) + ".png")),
        100u);
}

TEST_F(CliPaper, NoTriangles) {
  const json said = measure(kFuel + " --scaling 32x24 --range 1000 1001");
  for (const json &method : said["volumes"][0]["methods"]) {
    if (!method.value("refused", json()).is_null()) continue;  // a budget for rays without a block
    EXPECT_EQ(method["active_blocks"]["max"], 0);
  }
  EXPECT_EQ(said["volumes"][0]["methods"][5]["triangles"]["max"], 0);
  EXPECT_EQ(said["volumes"][0]["agreement"]["percent"], 100);
}

TEST_F(CliPaper, AllVolumesOfAFolderAndWhatABudgetRefuses) {
  const auto folder = folder_ / "volumes";
  std::filesystem::create_directory(folder);
  std::filesystem::copy(kFuel, folder);
  ASSERT_EQ(
      run_isowave("convert generate:sphere_20x20x20_uint8 -o " + quoted(folder / "s.zfp")).status,
      0);
  test::write_file(folder / "notes.txt", "no volume");
  test::write_file(folder / "unnamed.raw", "no dims");
  const json said =
      measure(quoted(folder) + " --scaling 32x24 --rate 4 --range 20 120 --bcmc-budget 100kB");
  ASSERT_EQ(said["volumes"].size(), 2u);
  EXPECT_EQ(said["volumes"][0]["isovalues"], said["volumes"][1]["isovalues"]) << "the same seed";
  EXPECT_THAT(said["volumes"][0]["volume"], HasSubstr("fuel"));
  EXPECT_THAT(said["volumes"][1]["volume"], HasSubstr("s.zfp"));
  EXPECT_THAT(out_, HasSubstr("skipped: "));
  EXPECT_THAT(out_, HasSubstr("unnamed.raw"));
  EXPECT_THAT(out_, testing::Not(HasSubstr("notes")));
  const json &bounded = said["volumes"][0]["methods"][6];
  EXPECT_THAT(bounded["refused"], HasSubstr("a memory budget of 100000 bytes is too small"));
  EXPECT_THAT(out_, HasSubstr("bcmc bounded       a memory budget of 100000 bytes is too small"));
}

TEST_F(CliPaper, RefusesWhatItCannotDo) {
  const std::string paper = "bench paper ";
  std::filesystem::create_directory(folder_ / "empty");
  expect_one_line_error(paper + quoted(folder_ / "empty"), "a folder without a volume");
  expect_one_line_error(paper + quoted(folder_ / "none.nrrd"), "none.nrrd");
  expect_one_line_error(paper + "generate:nothing_9x9x9_uint8", "nothing");
  expect_one_line_error(paper + kFuel + " --range 9 9", "--range 9 9");
  expect_one_line_error(paper + kFuel + " --isovalues 0", "--isovalues");
  expect_one_line_error(paper + kFuel + " --size 0x9", "image of 0 x 9");
  expect_one_line_error(paper + kFuel + " --scaling 12", "12");
  expect_one_line_error(paper + kFuel + " --limits 4,65", "65");
  expect_one_line_error(paper + kFuel + " --json " + quoted(folder_ / "no" / "j.json"),
                        "is no folder");
}

}  // namespace
}  // namespace isowave::core
