#pragma once
// The one exception of isowave: what went wrong, where, and what would help, in one line.

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

#include "isowave/error.hpp"

namespace isowave::core {

/// Escapes, as \n, \t or \x1b, what would end a line or move a cursor, and bytes that are not
/// UTF-8: names of files and strings from files may hold any.
std::string one_line(std::string_view text);

/// Anything a user can cause or fix: a bad file, a missing device, a budget too small.
/// what() is one line without a trailing newline (see one_line()); tools print it and exit with
/// status 1.
class Error : public isowave::Error {
 public:
  explicit Error(const std::string &message) : isowave::Error(one_line(message)) {}

  template <class... Args>
  explicit Error(fmt::format_string<Args...> format, Args &&...args)
      : Error(fmt::format(format, std::forward<Args>(args)...)) {}
};

/// An error of a compiler of kernels: what() names the first error, log() is the compiler's whole
/// message.
class BuildError : public Error {
 public:
  BuildError(const std::string &message, std::string log) : Error(message), log_(std::move(log)) {}
  const std::string &log() const { return log_; }

 private:
  std::string log_;
};

}  // namespace isowave::core
