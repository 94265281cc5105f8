#pragma once
// Why a call of the C library or of the system has failed.

#include <cerrno>
#include <system_error>

namespace isowave::core::platform {

/// errno as an error code; its message() is strerror()'s.
inline std::error_code last_failure() {
  return {errno, std::generic_category()};
}

}  // namespace isowave::core::platform
