#include "core/platform/new_file.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

std::FILE *make_nameless(const fs::path &) {
  return nullptr;
}

void give_name(std::FILE *, const fs::path &, std::error_code &failure) {
  failure = std::make_error_code(std::errc::function_not_supported);
}

/// There are no other programs.
fs::path name_while_open(std::FILE *) {
  return {};
}

void copy_access_list(const fs::path &, std::FILE *) {}

}  // namespace isowave::core::platform
