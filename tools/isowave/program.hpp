#pragma once
// The frame around each program's own work: errors in one line, a failing output is an error,
// options are strict.

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <utility>

namespace isowave::core::tools {

/// Parses the command line, which runs the callbacks of `app`, and returns the exit status.
/// Everything that is thrown becomes one line on stderr and status 1; so does a standard output
/// that cannot be written to. The files of a command that fails do not appear (OutputGroup). A
/// CLI::RuntimeError, of what has said already why it fails, gives its status alone. Options are
/// made strict first (strict_options.hpp).
int run_program(CLI::App &app, int argc, char **argv);

/// The whole of main(): calls work() and returns its exit status. If there is not even memory to
/// say what failed, or to describe the options, one line on stderr says so, and the status is 1.
int run_main(const std::function<int()> &work);

/// Exit status of the program.
inline constexpr std::pair<int, const char *> kExitStatuses[] = {
    {0, "all is done"},
    {1, "wrong input, a failure (one line on standard error says which), or a check that failed"},
    {130, "interrupted (Ctrl-C): no output is left half-written"}};

/// Prints "isowave: warning: TEXT" on standard error, where results are not.
void warn(const std::string &text);

/// "isowave 0.1.0"
std::string program_name();

}  // namespace isowave::core::tools
