#pragma once

#include <cstdlib>
#include <string>

namespace isowave::core::ocl {

/// The value of an environment variable; empty if there is none.
inline std::string environment(const char *name) {
  const char *value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace isowave::core::ocl
