#include "tools/isowave/program.hpp"

#include <execinfo.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
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
#include "core/io/atomic_file.hpp"
#include "core/ocl/arithmetic.hpp"
#include "core/ocl/device.hpp"
#include "core/ocl/driver_environment.hpp"
#include "isowave/version.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

/// Gives descriptors 0 to 2 that are closed to /dev/null, or the next file that is opened would be
/// standard input or output. In the wrong direction, so that whoever uses one finds that it fails.
void open_standard_streams() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(fd, F_GETFD) == -1 && errno == EBADF)
      ::open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY);
  }
}

/// To a file of its own in the folder for temporary files. Returns its name, or nothing where that
/// fails.
std::string keep_log(const std::string &log) {
  std::error_code failure;
  std::string name =
      (std::filesystem::temp_directory_path(failure) / "isowave_build_log_XXXXXX").string();
  const int fd = failure ? -1 : ::mkstemp(name.data());
  if (fd < 0) return {};
  const bool written = ::write(fd, log.data(), log.size()) == static_cast<ssize_t>(log.size());
  ::close(fd);
  if (written) return name;
  ::unlink(name.c_str());
  return {};
}

/// One line, to be called in a catch clause. What a compiler of kernels said is kept in a file.
std::string text_of_failure(const std::string &command) {
  try {
    throw;
  } catch (const BuildError &error) {
    const std::string name = error.log().empty() ? "" : keep_log(error.log());
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

/// Of a subcommand that is missing: CLI11 does not say that there is one of another name.
std::string text_of(const CLI::RequiredError &error, const CLI::App &app) {
  const std::vector<std::string> unknown = app.remaining(true);
  if (unknown.empty() || app.get_subcommands([](const CLI::App *) { return true; }).empty())
    return error.what();
  return fmt::format("{}; '{}' is none: see --help", error.what(), unknown.front());
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
  constexpr std::string_view kLine = "isowave: out of memory\n";
  static_cast<void>(!::write(STDERR_FILENO, kLine.data(), kLine.size()));
}

/// For exceptions that nothing can catch: of objects that are made before main() begins, and of
/// functions of libraries that must not throw and yet need memory (CLI11, libstdc++).
[[gnu::constructor(101)]] void end_without_memory() {
  std::set_terminate([] {
    print_out_of_memory();
    std::_Exit(1);
  });
}

/// Has glibc load its unwinder while there is memory. Else glibc does so when it first unwinds one
/// of its own functions, and aborts the process if it cannot.
void load_unwinder() {
  std::array<void *, 1> frames{};
  ::backtrace(frames.data(), frames.size());
}

}  // namespace

int run_main(const std::function<int()> &work) {
  load_unwinder();
  try {
    return work();
  } catch (...) {
    print_out_of_memory();
    return 1;
  }
}

int run_program(CLI::App &app, int argc, char **argv) {
  open_standard_streams();
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow further is an error like any other
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
