// What README.md says of the program's parts, where a program can tell.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <isowave/version.hpp>
#include <regex>
#include <sstream>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

const std::filesystem::path kRoot =
    std::filesystem::path(ISOWAVE_TEST_DATA).parent_path().parent_path();

/// The stems of README's table of stages.
std::vector<std::string> stage_stems() {
  std::istringstream readme(test::read_file(kRoot / "README.md"));
  std::vector<std::string> stems;
  std::string line;
  while (std::getline(readme, line) && !line.starts_with("| stage |")) {
  }
  while (std::getline(readme, line) && line.starts_with("|")) {
    std::istringstream columns(line);
    std::string column;
    for (int i = 0; i < 4; ++i) std::getline(columns, column, '|');
    static const std::regex kStem("`([a-z_]+)`");
    for (std::sregex_iterator it(column.begin(), column.end(), kStem), end; it != end; ++it)
      stems.push_back((*it)[1]);
  }
  return stems;
}

/// In the folder itself or in one of its rooms.
bool exists_below(const std::filesystem::path &folder, const std::string &name) {
  const auto is_it = [&](const std::filesystem::directory_entry &entry) {
    return entry.path().filename() == name;
  };
  return std::ranges::any_of(std::filesystem::recursive_directory_iterator(folder), is_it);
}

TEST(Readme, EveryStageHasItsFiles) {
  const std::vector<std::string> stems = stage_stems();
  EXPECT_GE(stems.size(), 15u);
  for (const std::string &stem : stems) {
    EXPECT_TRUE(exists_below(kRoot / "core", stem + ".hpp")) << stem;
    EXPECT_TRUE(exists_below(kRoot / "kernels_cl", stem + ".cl")) << stem;
    EXPECT_TRUE(exists(kRoot / "tests" / (stem + "_test.cpp"))) << stem;
    EXPECT_TRUE(exists(kRoot / "bench" / (stem + "_bench.cpp"))) << stem;
  }
}

TEST(Readme, CitationIsOfThisVersion) {
  EXPECT_THAT(test::read_file(kRoot / "CITATION.cff"),
              testing::HasSubstr("\nversion: " + std::string(isowave::version()) + "\n"));
}

TEST(Readme, AutoIsTheSamePipelineEverywhere) {
  EXPECT_THAT(test::read_file(kRoot / "README.md"),
              testing::HasSubstr("`--pipeline auto` takes `rays`"));
  EXPECT_THAT(test::run_isowave("render --help").out, testing::HasSubstr("auto (rays,"));
  EXPECT_THAT(test::run_isowave("render --help").out,
              testing::HasSubstr("what the driver takes for itself"));
  const test::TemporaryFolder folder;
  const std::string stats = test::quoted(folder / "stats.json");
  const auto run = test::run_isowave(
      "render " ISOWAVE_TEST_DATA
      "/nucleon_41x41x41_uint8.raw.gz -i 80 --size 16x12 --pipeline auto --stats " +
      stats);
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(test::read_file(folder / "stats.json"), testing::HasSubstr("\"pipeline\": \"rays\""));
}

}  // namespace
}  // namespace isowave::core
