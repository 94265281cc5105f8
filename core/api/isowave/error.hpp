#pragma once
// The one exception of the library.

#include <stdexcept>

namespace isowave {

/// Anything a user can cause or mend: a bad file, a missing device, a budget too small, an option
/// out of range. what() is one line that says what, where, and what would help.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace isowave
