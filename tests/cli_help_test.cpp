// What describes the command line: help, completion, manual page. And names that are not given.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <set>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::run_command;
using test::run_isowave;
using testing::Contains;
using testing::HasSubstr;

const std::string kFuel = ISOWAVE_TEST_DATA "/fuel_64x33x32_uint8.raw.gz";

const std::vector<std::string> kCommands = {
    "devices",       "info",         "generate",       "convert",    "render", "export",
    "extract",       "compare",      "verify",         "bench",      "man",    "completion",
    "bench solvers", "bench pareto", "bench topology", "bench paper"};

/// The long names of options that --help of a command lists.
std::set<std::string> options_of(const std::string &command) {
  const std::string help = run_isowave(command + " --help").out;
  static const std::regex kName("\n  (?:-[a-z],)?(--[a-z-]+)");
  std::set<std::string> names;
  for (std::sregex_iterator it(help.begin(), help.end(), kName), end; it != end; ++it)
    names.insert((*it)[1]);
  return names;
}

TEST(CliHelp, OptionsOfEveryDayComeFirst) {
  const std::string help = run_isowave("render --help").out;
  const std::size_t first = help.find("Options of every day:"), memory = help.find("Memory:"),
                    researchers = help.find("For researchers:");
  ASSERT_NE(first, std::string::npos);
  ASSERT_NE(researchers, std::string::npos);
  EXPECT_LT(first, help.find("--isovalue"));
  EXPECT_LT(help.find("--output"), memory);
  EXPECT_LT(memory, researchers);
  EXPECT_LT(researchers, help.find("--speculation"));
  EXPECT_EQ(help.find("\nOptions:"), std::string::npos) << "an option without a group";
}

TEST(CliHelp, ManualPageHasEveryOption) {
  const auto page = run_isowave("man");
  ASSERT_EQ(page.status, 0);
  for (const std::string &command : kCommands) {
    EXPECT_THAT(page.out, HasSubstr(".SS isowave " + command + "\n"));
    for (std::string option : options_of(command)) {
      option = std::regex_replace(option, std::regex("-"), "\\-");
      EXPECT_THAT(page.out, HasSubstr("\\fB" + option + "\\fR")) << command;
    }
  }
  for (const char *status : {"\\fB0\\fR", "\\fB1\\fR", "\\fB130\\fR"})
    EXPECT_THAT(page.out, HasSubstr(status));
  const auto troff =
      run_command(test::isowave_program() + " man | groff -man -ww -Tutf8 > /dev/null");
  EXPECT_EQ(troff.status, 0);
  EXPECT_EQ(troff.err, "");
}

TEST(CliHelp, BashCompletesCommandsOptionsAndChoices) {
  const auto complete = [](const std::string &words) {
    const test::TemporaryFolder folder;
    test::write_file(folder / "try.sh",
                     "source <(" + test::isowave_program() + " completion bash)\nCOMP_WORDS=(" +
                         words +
                         ")\nCOMP_CWORD=$((${#COMP_WORDS[@]} - 1))\n_isowave\nprintf "
                         "'%s\\n' \"${COMPREPLY[@]}\"\n");
    std::istringstream lines(run_command("bash " + test::quoted(folder / "try.sh")).out);
    std::set<std::string> all;
    for (std::string line; std::getline(lines, line);) all.insert(line);
    return all;
  };
  EXPECT_EQ(complete("isowave ren"), std::set<std::string>{"render"});
  EXPECT_EQ(complete("isowave bench par"), std::set<std::string>{"pareto"});
  EXPECT_EQ(complete("isowave render --pipeline ''"),
            (std::set<std::string>{"auto", "blocks", "rays"}));
  for (const std::string &command : kCommands) {
    const std::set<std::string> proposed = complete("isowave " + command + " -");
    for (const std::string &option : options_of(command))
      EXPECT_THAT(proposed, Contains(option)) << command;
  }
}

TEST(CliHelp, OtherShellsGetEveryOption) {
  const std::string fish = run_isowave("completion fish").out;
  EXPECT_THAT(run_isowave("completion zsh").out, testing::StartsWith("#compdef isowave\n"));
  for (const std::string &command : kCommands) {
    for (const std::string &option : options_of(command))
      EXPECT_THAT(fish, HasSubstr(" -l " + option.substr(2))) << command;
  }
  test::expect_one_line_error("completion tcsh", "SHELL");
}

TEST(CliNames, APictureIsNamedAfterItsVolume) {
  const test::TemporaryFolder folder;
  const auto run = [&](const std::string &arguments) {
    return run_command("cd " + test::quoted(folder / "") + " && " + test::isowave_program() +
                       " render " + arguments + " --size 16x12");
  };
  const auto one = run(kFuel + " -i 40");
  EXPECT_EQ(one.status, 0) << one.err;
  EXPECT_THAT(one.out, HasSubstr("wrote fuel_64x33x32_uint8_iso40.png"));
  EXPECT_TRUE(exists(folder / "fuel_64x33x32_uint8_iso40.png"));
  EXPECT_EQ(run("generate:plane_8x8x8_float32 -i 0.25 -i -1e-5").status, 0);
  EXPECT_TRUE(exists(folder / "plane_8x8x8_float32_iso0.25_view0.png"));
  EXPECT_TRUE(exists(folder / "plane_8x8x8_float32_iso-1e-05_view0.png"));
  EXPECT_EQ(run("generate:mixing_layer_8x8x8_uint8:7 -i 128 --orbit 2").status, 0);
  EXPECT_TRUE(exists(folder / "mixing_layer_8x8x8_uint8_7_iso128_view1.png"));
  const std::size_t before = folder.num_files();
  EXPECT_EQ(run(kFuel + " -i 41 --stats only.json").status, 0);
  EXPECT_EQ(folder.num_files(), before + 1) << "no picture, where something else is asked for";
}

TEST(CliNames, WhatGenerateWritesIsOpenedAsItSays) {
  const test::TemporaryFolder folder;
  const std::string enter = "cd " + test::quoted(folder / "") + " && ";
  for (const std::string output : {"", "-o a.nrrd", "-o b.raw"}) {
    const auto made = run_command(enter + test::isowave_program() +
                                  " generate gyroid --dims 9 8 7 --type uint16 " + output);
    ASSERT_EQ(made.status, 0) << made.err;
    const std::size_t next = made.out.find("draw it: isowave ");
    ASSERT_NE(next, std::string::npos);
    const std::string command = made.out.substr(next + 17, made.out.find('\n', next) - next - 17);
    EXPECT_EQ(command.find("--dims") != std::string::npos, output == "-o b.raw") << command;
    const auto drawn =
        run_command(enter + test::isowave_program() + " " + command + " --size 16x12");
    EXPECT_EQ(drawn.status, 0) << command << drawn.err;
    EXPECT_THAT(drawn.out, testing::Not(HasSubstr(" 0 rays hit")));
  }
  test::expect_one_line_error("generate gyroid --dims 8 -o a.tif", ".nrrd");
}

}  // namespace
}  // namespace isowave::core
