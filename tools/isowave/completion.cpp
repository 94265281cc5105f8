// `isowave completion`: scripts that complete command lines of isowave, for three shells.

#include <fmt/format.h>

#include <memory>

#include "tools/isowave/command_tree.hpp"
#include "tools/isowave/commands.hpp"

namespace isowave::core::tools {

namespace {

/// "bench pareto" of "isowave bench pareto"; "" of the program.
std::string path_of(const DescribedCommand &command) {
  const std::size_t space = command.name.find(' ');
  return space == std::string::npos ? "" : command.name.substr(space + 1);
}

/// The words that may follow a command: its commands and options.
std::vector<std::string> words_of(const DescribedCommand &command) {
  std::vector<std::string> words;
  for (const DescribedCommand &sub : command.commands)
    words.push_back(sub.name.substr(sub.name.rfind(' ') + 1));
  for (const DescribedOption &option : command.options) {
    if (!option.is_positional) words.insert(words.end(), option.names.begin(), option.names.end());
  }
  return words;
}

template <class Use>
void for_each_command(const DescribedCommand &command, const Use &use) {
  use(command);
  for (const DescribedCommand &sub : command.commands) for_each_command(sub, use);
}

/// In single quotes.
std::string quoted(std::string text) {
  for (std::size_t at = 0; (at = text.find('\'', at)) != std::string::npos; at += 4)
    text.replace(at, 1, "'\\''");
  return "'" + text + "'";
}

/// Completes commands, options, choices and files; zsh runs it by its bashcompinit.
std::string bash_script(const DescribedCommand &program) {
  std::string cases, choices;
  for_each_command(program, [&](const DescribedCommand &command) {
    cases += fmt::format("    {}) words={}{} ;;\n", quoted(path_of(command)),
                         quoted(fmt::format("{}", fmt::join(words_of(command), " "))),
                         command.commands.empty() ? "" : " any=1");
    for (const DescribedOption &option : command.options) {
      if (option.choices.empty() || option.is_positional) continue;
      for (const std::string &name : option.names)
        choices += fmt::format("    {}) words={} ;;\n", quoted(path_of(command) + " " + name),
                               quoted(fmt::format("{}", fmt::join(option.choices, " "))));
    }
  });
  std::string paths;
  for_each_command(program, [&](const DescribedCommand &command) {
    if (const std::string path = path_of(command); !path.empty()) paths += quoted(path) + "|";
  });
  paths.pop_back();
  return fmt::format(R"(# Completes command lines of isowave in bash.
_isowave() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}}
  local path= words= any= i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case "${{path:+$path }}${{COMP_WORDS[i]}}" in
    {}) path="${{path:+$path }}${{COMP_WORDS[i]}}" ;;
    esac
  done
  case "$path $previous" in
{}    *)
      case "$path" in
{}      esac
      [[ $current == -* || -n $any ]] || words= ;;
  esac
  COMPREPLY=($(compgen -W "$words" -- "$current"))
  [[ -n $words ]] || COMPREPLY=($(compgen -f -- "$current"))
}}
complete -o filenames -F _isowave isowave
)",
                     paths, choices, cases);
}

std::string zsh_script(const DescribedCommand &program) {
  return "#compdef isowave\nautoload -Uz bashcompinit && bashcompinit\n" + bash_script(program);
}

std::string fish_script(const DescribedCommand &program) {
  std::string script = "# Completes command lines of isowave in fish.\n";
  for_each_command(program, [&](const DescribedCommand &command) {
    const std::string path = path_of(command);
    const std::string condition =
        path.empty() ? "__fish_use_subcommand"
                     : "__fish_seen_subcommand_from " + path.substr(path.rfind(' ') + 1);
    for (const DescribedCommand &sub : command.commands) {
      script += fmt::format("complete -c isowave -f -n {} -a {} -d {}\n", quoted(condition),
                            sub.name.substr(sub.name.rfind(' ') + 1), quoted(sub.description));
    }
    for (const DescribedOption &option : command.options) {
      if (option.is_positional) continue;
      script += fmt::format("complete -c isowave -n {}", quoted(condition));
      for (const std::string &name : option.names)
        script += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      if (!option.choices.empty())
        script +=
            fmt::format(" -x -a {}", quoted(fmt::format("{}", fmt::join(option.choices, " "))));
      else if (!option.value.empty())
        script += " -r";
      script += fmt::format(" -d {}\n", quoted(option.description));
    }
  });
  return script;
}

}  // namespace

void add_completion(CLI::App &app) {
  const auto shell = std::make_shared<std::string>();
  CLI::App *command = app.add_subcommand("completion", "Print a script that completes commands");
  command->add_option("SHELL", *shell, "shell that the script is for")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->callback([&app, shell] {
    const DescribedCommand program = describe(app);
    fmt::print("{}", *shell == "bash"  ? bash_script(program)
                     : *shell == "zsh" ? zsh_script(program)
                                       : fish_script(program));
  });
}

}  // namespace isowave::core::tools
