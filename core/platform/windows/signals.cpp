#include "core/platform/signals.hpp"

#include <cstdlib>
#include <filesystem>

namespace isowave::core::platform {

/// Windows has no such limit.
void survive_file_size_limit() {}

/// A process that is ended from outside gets no time.
void remove_at_end(const std::string &name) {
  static std::filesystem::path unfinished_file;
  static const int registered = std::atexit([] {
    std::error_code failure;
    std::filesystem::remove(unfinished_file, failure);
  });
  static_cast<void>(registered);
  unfinished_file = name;
}

}  // namespace isowave::core::platform
