#include "tools/isowave/program.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include "core/api/guarded.hpp"
#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/atomic_file.hpp"
#include "core/ocl/arithmetic.hpp"
#include "core/ocl/device.hpp"
#include "core/ocl/driver_environment.hpp"
#include "core/platform/file.hpp"
#include "core/platform/process.hpp"
#include "core/platform/signals.hpp"
#include "core/platform/streams.hpp"
#include "isowave/version.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

/// One line, to be called in a catch clause. What a compiler of kernels said is kept in a file.
std::string text_of_failure(const std::string &command) {
  try {
    throw;
  } catch (const BuildError &error) {
    const std::string name =
        error.log().empty()
            ? ""
            : platform::keep_in_temporary_folder("isowave_build_log", error.log()).string();
    return error.what() +
           (name.empty() ? "" : fmt::format("; the compiler's whole log is {}", name));
  } catch (...) {
    return text_of_current_exception(command);
  }
}

/// Writes out what is left of standard output. Returns why it cannot be written to, or nothing.
std::optional<std::string> finish_output() {
  errno = 0;
  std::cout.flush();
  const bool failed = std::fflush(stdout) != 0 || std::ferror(stdout) != 0 || std::cout.fail();
  if (!failed) return {};
  return "cannot write to standard output" +
         (errno != 0 ? fmt::format(": {}", std::strerror(errno)) : "");
}

/// The text for a missing subcommand. CLI11 does not say that an unknown one was given.
std::string text_of(const CLI::RequiredError &error, const CLI::App &app) {
  const std::vector<std::string> unknown = app.remaining(true);
  if (unknown.empty() || app.get_subcommands([](const CLI::App *) { return true; }).empty())
    return error.what();
  return fmt::format("{}; '{}' is none: see --help", error.what(), unknown.front());
}

/// The arguments that no command takes, in their order. A shell makes files of a pattern.
std::string text_of_extras(const CLI::App &app) {
  const std::vector<std::string> extras = app.remaining(true);
  const auto is_file = [](const std::string &name) {
    std::error_code failure;
    return std::filesystem::is_regular_file(name, failure);
  };
  return fmt::format("unexpected argument{} {}: {}", plural(extras.size(), "", "s"),
                     fmt::join(extras, " "),
                     app.got_subcommand("render") && std::ranges::all_of(extras, is_file)
                         ? "put the pattern of a series in quotes: 'run_*.nrrd'"
                         : "see --help");
}

/// The program and the subcommand that was asked for: "isowave bench pareto".
std::string command_name(const CLI::App &app) {
  std::string name = app.get_name();
  for (const CLI::App *command = &app; !command->get_subcommands().empty();) {
    command = command->get_subcommands().front();
    name += " " + command->get_name();
  }
  return name;
}

void print_line(const std::string &name, const std::string &text) {
  const std::string line = fmt::format("{}: {}\n", name, one_line(text));
  std::fwrite(line.data(), 1, line.size(), stderr);  // a failure cannot be told
}

/// Takes no memory.
void print_out_of_memory() {
  platform::write_error("isowave: out of memory\n");
}

/// For exceptions that nothing can catch: of objects that are made before main() begins, and of
/// functions of libraries that must not throw and yet need memory (CLI11, libstdc++).
[[gnu::constructor(101)]] void end_without_memory() {
  std::set_terminate([] {
    print_out_of_memory();
    std::_Exit(1);
  });
}

}  // namespace

int run_main(const std::function<int()> &work) {
  platform::load_unwinder();
  try {
    return work();
  } catch (...) {
    print_out_of_memory();
    return 1;
  }
}

int run_program(CLI::App &app, int argc, char **argv) {
  platform::open_standard_streams();
  platform::survive_file_size_limit();
  OutputGroup outputs;
  std::optional<std::string> message;
  int status = 1;
  try {
    make_strict(app);
    refuse_empty_values(app, argc, argv);
    app.parse(argc, argv);
    status = 0;
  } catch (const CLI::Success &help) {
    std::ostringstream text;
    status = app.exit(help, text, text);
    std::fputs(text.str().c_str(), stdout);
  } catch (const CLI::RuntimeError &result) {
    status = result.get_exit_code();
  } catch (const CLI::RequiredError &error) {
    message = text_of(error, app);
  } catch (const CLI::ExtrasError &) {
    message = text_of_extras(app);
  } catch (...) {
    message = text_of_failure(command_name(app));
  }
  if (const auto failure = finish_output()) message = failure;
  try {
    if (!message) outputs.commit();
  } catch (...) {
    message = text_of_failure(command_name(app));
  }
  if (message) {
    print_line(app.get_name(), *message);
    return 1;
  }
  for (const std::string &notice : ocl::arithmetic_notices()) warn(notice);
  if (const std::string notice = ocl::cache_notice(); status == 0 && !notice.empty())
    print_line(app.get_name(), notice);
  return status;
}

void warn(const std::string &text) {
  print_line("isowave", "warning: " + text);
}

std::string program_name() {
  return fmt::format("isowave {}", version());
}

}  // namespace isowave::core::tools
