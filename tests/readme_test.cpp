// What documents say of the program's parts, where a program can tell.

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

/// Every README.md, and what else is written for people at the top; no folder of a build.
std::vector<std::filesystem::path> documents() {
  std::vector<std::filesystem::path> found{kRoot / "README.md", kRoot / "CONTRIBUTING.md",
                                           kRoot / "CHANGELOG.md"};
  for (const char *folder : {"core", "kernels_cl", "reference", "bench", "tests", "tools"}) {
    for (const auto &entry : std::filesystem::recursive_directory_iterator(kRoot / folder))
      if (entry.path().extension() == ".md") found.push_back(entry.path());
  }
  return found;
}

std::vector<std::string> lines_of(const std::filesystem::path &path) {
  std::istringstream text(test::read_file(path));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

/// The stems of a room's table of stages.
std::vector<std::string> stage_stems(const std::string &room) {
  std::istringstream readme(test::read_file(kRoot / "core" / room / "README.md"));
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
  std::vector<std::string> stems = stage_stems("render");
  EXPECT_GE(stems.size(), 15u);
  const std::vector<std::string> of_paper = stage_stems("paper");
  EXPECT_GE(of_paper.size(), 10u);
  stems.insert(stems.end(), of_paper.begin(), of_paper.end());
  for (const std::string &stem : stems) {
    EXPECT_TRUE(exists_below(kRoot / "core", stem + ".hpp")) << stem;
    EXPECT_TRUE(exists_below(kRoot / "kernels_cl", stem + ".cl")) << stem;
    EXPECT_TRUE(exists(kRoot / "tests" / (stem + "_test.cpp"))) << stem;
    EXPECT_TRUE(exists(kRoot / "bench" / (stem + "_bench.cpp"))) << stem;
  }
}

TEST(Readme, FrontPageIsShort) {
  const std::vector<std::string> lines = lines_of(kRoot / "README.md");
  EXPECT_LE(lines.size(), 150u);
  for (const std::string &line : lines) EXPECT_LE(line.size(), 100u) << line;
}

/// Tables, pictures' texts and addresses cannot be broken.
TEST(Readme, ProseHasOneWidth) {
  for (const std::filesystem::path &document : documents()) {
    bool code = false;
    for (const std::string &line : lines_of(document)) {
      if (line.starts_with("```")) code = !code;
      if (code || line.starts_with("|") || line.find_first_of(" ", 2) == std::string::npos)
        continue;
      EXPECT_TRUE(line.size() <= 100 || line.find("](") != std::string::npos ||
                  line.starts_with("  `{"))
          << document << ": " << line;
    }
  }
}

TEST(Readme, LinksLeadSomewhere) {
  static const std::regex kLink("\\]\\(([^)#]+)[^)]*\\)");
  std::size_t links = 0;
  for (const std::filesystem::path &document : documents()) {
    const std::string text = test::read_file(document);
    for (std::sregex_iterator it(text.begin(), text.end(), kLink), end; it != end; ++it) {
      const std::string target = (*it)[1];
      if (target.starts_with("http")) continue;
      EXPECT_TRUE(exists(document.parent_path() / target)) << document << ": " << target;
      ++links;
    }
  }
  EXPECT_GE(links, 15u);
}

/// Files that documents name in code font with a folder before them, e.g. `core/view/detail.hpp`.
TEST(Readme, FilesThatAreNamedExist) {
  static const std::regex kFile(
      "`((core|kernels_cl|reference|bench|tests|tools)/[A-Za-z0-9_/.-]+)`");
  std::size_t files = 0;
  for (const std::filesystem::path &document : documents()) {
    const std::string text = test::read_file(document);
    for (std::sregex_iterator it(text.begin(), text.end(), kFile), end; it != end; ++it) {
      EXPECT_TRUE(exists(kRoot / (*it)[1].str())) << document << ": " << (*it)[1];
      ++files;
    }
  }
  EXPECT_GE(files, 20u);
}

TEST(Readme, CitationIsOfThisVersion) {
  EXPECT_THAT(test::read_file(kRoot / "CITATION.cff"),
              testing::HasSubstr("\nversion: " + std::string(isowave::version()) + "\n"));
}

TEST(Readme, AutoIsTheSamePipelineEverywhere) {
  EXPECT_THAT(test::read_file(kRoot / "core/render/README.md"),
              testing::HasSubstr("`--pipeline auto` takes `rays`"));
  EXPECT_THAT(test::run_isowave("render --help").out, testing::HasSubstr("auto (rays,"));
  EXPECT_THAT(test::run_isowave("render --help").out,
              testing::HasSubstr("what the driver takes for itself"));
  const test::TemporaryFolder folder;
  const std::string stats = test::quoted(folder / "stats.json");
  const auto run =
      test::run_isowave("render " ISOWAVE_TEST_DATA
                        "/head_41x41x41_uint8.raw.gz -i 80 --size 16x12 --pipeline auto --stats " +
                        stats);
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(test::read_file(folder / "stats.json"), testing::HasSubstr("\"pipeline\": \"rays\""));
}

}  // namespace
}  // namespace isowave::core
