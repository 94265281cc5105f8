#include <fcntl.h>
#include <fmt/format.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <array>

#include "core/platform/last_failure.hpp"
#include "core/platform/new_file.hpp"
#include "core/platform/stream_of.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

/// Old file systems have no such files.
std::FILE *make_nameless(const fs::path &folder) {
  if (::access("/proc/self/fd", X_OK) != 0) return nullptr;  // give_name() needs it
  std::error_code failure;
  return stream_of(::open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0666), failure);
}

void give_name(std::FILE *nameless, const fs::path &path, std::error_code &failure) {
  const fs::path self = name_while_open(nameless);
  const int result = ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, path.c_str(), AT_SYMLINK_FOLLOW);
  failure = result == 0 ? std::error_code() : last_failure();
}

fs::path name_while_open(std::FILE *file) {
  return fmt::format("/proc/{}/fd/{}", ::getpid(), ::fileno(file));
}

void copy_access_list(const fs::path &replaced, std::FILE *file) {
  constexpr const char *kAccessList = "system.posix_acl_access";
  std::array<char, 1 << 12> list{};
  const ssize_t length = ::getxattr(replaced.c_str(), kAccessList, list.data(), list.size());
  if (length > 0)
    ::fsetxattr(::fileno(file), kAccessList, list.data(), static_cast<std::size_t>(length), 0);
}

}  // namespace isowave::core::platform
