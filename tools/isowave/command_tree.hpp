#pragma once
// The commands and options of the command line, for completion scripts and the man page. CLI11
// supplies them, so that nothing is written twice.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace isowave::core::tools {

struct DescribedOption {
  std::vector<std::string> names;    ///< "-o", "--output"; of a positional one, its name
  std::string value;                 ///< "TEXT"; empty: a flag
  std::string default_value;         ///< empty: none
  std::vector<std::string> choices;  ///< all that its value can be; empty: anything
  std::string description, group;
  bool is_positional = false, is_required = false;
};

struct DescribedCommand {
  std::string name;  ///< "isowave bench pareto"
  std::string description;
  std::vector<DescribedOption> options;  ///< in the order of --help
  std::vector<DescribedCommand> commands;
};

/// Options and commands that --help does not show are left out.
DescribedCommand describe(const CLI::App &app, const std::string &prefix = "");

}  // namespace isowave::core::tools
