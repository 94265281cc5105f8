#include "tools/isowave/command_tree.hpp"

namespace isowave::core::tools {

namespace {

/// The values in "TEXT:{auto,blocks,rays}", as CLI11 describes one of a set.
std::vector<std::string> choices_of(const std::string &type) {
  const std::size_t begin = type.find('{'), end = type.find('}');
  if (begin == std::string::npos || end == std::string::npos) return {};
  return CLI::detail::split(type.substr(begin + 1, end - begin - 1), ',');
}

DescribedOption describe_option(const CLI::Option &option) {
  DescribedOption result;
  result.is_positional = option.get_positional();
  if (result.is_positional) result.names.push_back(option.get_name(true));
  for (const std::string &name : option.get_snames()) result.names.push_back("-" + name);
  for (const std::string &name : option.get_lnames()) result.names.push_back("--" + name);
  const std::string type = option.get_type_name();
  if (option.get_type_size() != 0) result.value = type.substr(0, type.find(':'));
  result.choices = choices_of(type);
  result.default_value = option.get_default_str();
  result.description = option.get_description();
  result.group = option.get_group();
  result.is_required = option.get_required();
  return result;
}

}  // namespace

DescribedCommand describe(const CLI::App &app, const std::string &prefix) {
  DescribedCommand result;
  result.name = prefix + app.get_name();
  result.description = app.get_description();
  // By groups, as --help has them; positional ones first.
  const std::vector<const CLI::Option *> all = app.get_options();
  for (const CLI::Option *option : all) {
    if (option->get_positional()) result.options.push_back(describe_option(*option));
  }
  for (const std::string &group : app.get_groups()) {
    if (group.empty()) continue;  // hidden
    for (const CLI::Option *option : all) {
      if (!option->get_positional() && option->get_group() == group)
        result.options.push_back(describe_option(*option));
    }
  }
  for (const CLI::App *command : app.get_subcommands([](const CLI::App *) { return true; })) {
    if (!command->get_group().empty())
      result.commands.push_back(describe(*command, result.name + " "));
  }
  return result;
}

}  // namespace isowave::core::tools
