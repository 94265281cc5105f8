#pragma once
// Private to core/api: whatever goes wrong behind the front door leaves it as isowave::Error.

#include <string>
#include <string_view>

#include "core/base/error.hpp"

namespace isowave::core {

/// What the exception at work says, in one line. To be called in a catch clause. doing: what
/// failed, for exceptions that do not say that: "isowave render".
std::string text_of_current_exception(std::string_view doing);

/// Calls work() and returns what it returns.
///
/// Throws  Error alone
template <class Work>
auto guarded(std::string_view doing, const Work &work) {
  try {
    return work();
  } catch (const isowave::Error &) {
    throw;
  } catch (...) {
    throw Error(text_of_current_exception(doing));
  }
}

}  // namespace isowave::core
