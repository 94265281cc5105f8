#pragma once
// The order in which people read the options of a command.

#include <CLI/CLI.hpp>
#include <initializer_list>
#include <string>

namespace isowave::core::tools {

/// Lists these options of the command under a title. Titles come in the order of the first option
/// that was added to the command; --help is of the first. An option that the command does not have
/// is a std::logic_error.
void group_options(CLI::App &command, const std::string &title,
                   std::initializer_list<const char *> names);

/// The groups of options that several commands have.
void group_volume_options(CLI::App &command);
void group_compression_options(CLI::App &command);

}  // namespace isowave::core::tools
