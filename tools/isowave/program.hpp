#pragma once
// What every program of ours does around its own work: errors in one line, an output that fails is
// one, options are strict.

#include <CLI/CLI.hpp>
#include <string>

namespace isowave::core::tools {

/// Parses the command line, which runs the callbacks of `app`, and returns the exit status.
/// Everything that is thrown becomes one line on stderr and status 1; so does a standard output
/// that cannot be written to. A CLI::RuntimeError, of what has said already why it fails, gives its
/// status alone. Options are made strict first (strict_options.hpp).
int run_program(CLI::App &app, int argc, char **argv);

/// "isowave 0.1.0"
std::string program_name();

}  // namespace isowave::core::tools
