#pragma once
// Other programs that this process starts.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <vector>

namespace isowave::core::platform {

/// The program of that name in the folders of PATH; empty if there is none that this user may run.
std::filesystem::path find_program(const std::string &name);

/// A program at work, which reads what this process writes. Destroyed before finish(), it ends the
/// program.
class ChildProcess {
 public:
  /// Starts a program, without a shell. Its standard output goes nowhere.
  ChildProcess(const std::filesystem::path &program, const std::vector<std::string> &arguments,
               std::error_code &failure);
  ~ChildProcess();
  ChildProcess(const ChildProcess &) = delete;
  ChildProcess &operator=(const ChildProcess &) = delete;

  /// Writes to the program's standard input, and waits until it has read most. A program that has
  /// ended is a failure, not a signal.
  void write(std::span<const std::byte> bytes, std::error_code &failure);
  /// Closes its standard input and waits for its end. Call once, nothing may follow.
  ///
  /// Returns  the exit status, or 128 + the signal that ended it
  int finish();
  /// What it wrote to standard error: the last 64 KiB. Call it after finish().
  std::string errors() const;

 private:
  void close_input();

  std::optional<std::int64_t> id_;  ///< none: it does not run
  int input_ = -1, errors_ = -1;    ///< file descriptors
};

}  // namespace isowave::core::platform
