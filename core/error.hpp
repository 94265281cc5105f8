#pragma once
// The one exception of isowave: what went wrong, where, and what would help, in one line.

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace isowave {

/// Anything a user can cause or fix: a bad file, a missing device, a budget too small.
/// what() is one line without a trailing newline; tools print it and exit with status 1.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string &message) : std::runtime_error(message) {}

  template <class... Args>
  explicit Error(fmt::format_string<Args...> format, Args &&...args)
      : std::runtime_error(fmt::format(format, std::forward<Args>(args)...)) {}
};

}  // namespace isowave
