#pragma once
// Environment variables in tests.

#include <cstdlib>
#include <optional>
#include <string>

namespace isowave::core::test {

/// Sets an environment variable for as long as it lives.
class Setting {
 public:
  Setting(const char *name, const std::string &value) : name_(name) {
    if (const char *before = std::getenv(name)) before_ = before;
    ::setenv(name, value.c_str(), 1);
  }
  ~Setting() { before_ ? ::setenv(name_, before_->c_str(), 1) : ::unsetenv(name_); }
  Setting(const Setting &) = delete;
  Setting &operator=(const Setting &) = delete;

 private:
  const char *name_;
  std::optional<std::string> before_;
};

}  // namespace isowave::core::test
