#pragma once
// Standard input, output and error.

#include <string_view>

namespace isowave::core::platform {

/// Opens standard streams that are closed: otherwise the next file that is opened would be one of
/// them. Reading and writing there fails.
void open_standard_streams();

/// Whether a person may be reading standard error.
bool errors_go_to_terminal();

/// Writes to standard error without taking memory. Returns whether it could.
bool write_error(std::string_view text);

/// Has standard output and standard error go nowhere from now on.
void fall_silent();
/// Writes to what standard error was before fall_silent(). Returns whether it could.
bool write_error_aloud(std::string_view text);

/// Standard error goes nowhere as long as this lives. Keeps errno.
class HushedErrors {
 public:
  HushedErrors();
  ~HushedErrors();
  HushedErrors(const HushedErrors &) = delete;
  HushedErrors &operator=(const HushedErrors &) = delete;

 private:
  int errors_, nowhere_;
};

}  // namespace isowave::core::platform
