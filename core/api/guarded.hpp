#pragma once
// Private to core/api: whatever goes wrong behind the front door leaves it as isowave::Error.

#include <string>
#include <string_view>

#include "core/base/error.hpp"

namespace isowave::core {

/// The text of the current exception, in one line. Call it in a catch clause. doing: what failed,
/// for exceptions that do not say it: "isowave render".
std::string text_of_current_exception(std::string_view doing);

/// Calls work() and returns what it returns.
///
/// Throws  only Error
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
