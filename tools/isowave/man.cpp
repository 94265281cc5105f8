// `isowave man`: the manual page, in the man macros of troff.

#include <fmt/format.h>

#include <ranges>

#include "isowave/version.hpp"
#include "tools/isowave/command_tree.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/program.hpp"

namespace isowave::core::tools {

namespace {

/// Text that troff prints as it is.
std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '\\')
      result += "\\e";
    else if (c == '-')
      result += "\\-";
    else
      result += c;
  }
  if (!result.empty() && (result[0] == '.' || result[0] == '\'')) result.insert(0, "\\&");
  return result;
}

/// "\fB-o\fR, \fB--output\fR \fITEXT\fR"
std::string names_of(const DescribedOption &option) {
  std::string result;
  for (const std::string &name : option.names) {
    if (!result.empty()) result += ", ";
    result += fmt::format("\\f{}{}\\fR", option.is_positional ? 'I' : 'B', escaped(name));
  }
  if (!option.is_positional && !option.value.empty())
    result += fmt::format(" \\fI{}\\fR", escaped(option.value));
  return result;
}

std::string text_of(const DescribedOption &option) {
  std::string text = option.description;
  if (!option.choices.empty()) text += fmt::format(" (one of {})", fmt::join(option.choices, ", "));
  if (!option.default_value.empty()) text += fmt::format(" [{}]", option.default_value);
  return escaped(text);
}

void append(const DescribedCommand &command, std::string &page) {
  for (const DescribedCommand &sub : command.commands) {
    page += fmt::format(".SS {}\n{}\n", escaped(sub.name), escaped(sub.description));
    std::string group;
    for (const DescribedOption &option : sub.options) {
      if (!option.is_positional && option.group != group) {
        group = option.group;
        page += fmt::format(".PP\n{}:\n", escaped(group));
      }
      page += fmt::format(".TP\n{}\n{}\n", names_of(option), text_of(option));
    }
    append(sub, page);
  }
}

std::string page_of(const CLI::App &app) {
  const DescribedCommand program = describe(app);
  std::string page = fmt::format(
      ".TH ISOWAVE 1 \"\" \"isowave {}\" \"User Commands\"\n.SH NAME\nisowave \\- isosurfaces of "
      "compressed volumes\n.SH SYNOPSIS\n\\fBisowave\\fR \\fICOMMAND\\fR [\\fIOPTION\\fR]...\n"
      ".SH DESCRIPTION\n{}\n.SH COMMANDS\n",
      isowave::version(), escaped(program.description));
  append(program, page);
  page += ".SH EXIT STATUS\n";
  for (const auto &[status, meaning] : kExitStatuses)
    page += fmt::format(".TP\n\\fB{}\\fR\n{}\n", status, escaped(meaning));
  page += ".SH ENVIRONMENT\n.TP\n\\fBISOWAVE_DEVICE\\fR\n";
  page += "The device, or host, that is taken if \\-\\-device does not say another.\n";
  page += ".SH EXAMPLES\n.nf\nisowave render head.nrrd \\-i 500\n";
  page += "isowave convert head.nrrd \\-\\-tolerance 0.5 \\-o head.zfp\n";
  page += "isowave render head.zfp \\-i 500 \\-\\-orbit 36 \\-o turn.png\n.fi\n";
  return page;
}

}  // namespace

void add_man(CLI::App &app) {
  CLI::App *command = app.add_subcommand("man", "Print the manual page, for man -l -");
  command->callback([&app] { fmt::print("{}", page_of(app)); });
}

}  // namespace isowave::core::tools
