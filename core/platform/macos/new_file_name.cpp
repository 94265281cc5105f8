#include <copyfile.h>
#include <fcntl.h>
#include <unistd.h>

#include <array>

#include "core/platform/new_file.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

/// macOS has no such files.
std::FILE *make_nameless(const fs::path &) {
  return nullptr;
}

void give_name(std::FILE *, const fs::path &, std::error_code &failure) {
  failure = std::make_error_code(std::errc::function_not_supported);
}

fs::path name_while_open(std::FILE *file) {
  std::array<char, 4096> name{};
  return ::fcntl(::fileno(file), F_GETPATH, name.data()) == 0 ? fs::path(name.data()) : fs::path();
}

void copy_access_list(const fs::path &replaced, std::FILE *file) {
  const int old = ::open(replaced.c_str(), O_RDONLY | O_CLOEXEC);
  if (old < 0) return;
  ::fcopyfile(old, ::fileno(file), nullptr, COPYFILE_ACL);
  ::close(old);
}

}  // namespace isowave::core::platform
