#pragma once
// The one exception of the library.

#include <stdexcept>

namespace isowave {

/// A failure that a user can cause or mend: a bad file, a missing device, a budget that is too
/// small, an option out of range. what() is one line: what is wrong, where, and what would help.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace isowave
