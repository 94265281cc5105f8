#include "core/platform/new_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/platform/last_failure.hpp"
#include "core/platform/stream_of.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

namespace {

bool has_access(const fs::path &path, int rights, std::error_code &failure) {
  failure = ::access(path.c_str(), rights) == 0 ? std::error_code() : last_failure();
  return !failure;
}

}  // namespace

std::FILE *make_new(const fs::path &path, std::error_code &failure) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  std::FILE *const stream = stream_of(descriptor, failure);
  if (stream == nullptr && descriptor >= 0) ::unlink(path.c_str());
  return stream;
}

void keep_permissions(const fs::path &replaced, std::FILE *file) {
  const int descriptor = ::fileno(file);
  struct stat old {
  }, made{};
  if (::stat(replaced.c_str(), &old) != 0 || ::fstat(descriptor, &made) != 0) return;
  mode_t mode = old.st_mode & 0777;
  constexpr auto kSameUser = static_cast<uid_t>(-1);
  constexpr auto kSameGroup = static_cast<gid_t>(-1);
  if (old.st_gid != made.st_gid && ::fchown(descriptor, kSameUser, old.st_gid) != 0)
    mode &= ~static_cast<mode_t>(S_IRWXG);  // they would be the rights of another group
  // Only root can give a file away: an ordinary user becomes the owner.
  if (old.st_uid != made.st_uid && ::fchown(descriptor, old.st_uid, kSameGroup) != 0) errno = 0;
  // Before the mode, which then also limits what the list grants.
  copy_access_list(replaced, file);
  ::fchmod(descriptor, mode);
}

std::uint64_t size_of(std::FILE *file) {
  struct stat status {};
  return ::fstat(::fileno(file), &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

std::string identity_of(const fs::path &path, std::error_code &failure) {
  struct stat status {};
  failure = ::stat(path.c_str(), &status) == 0 ? std::error_code() : last_failure();
  return failure ? "" : fmt::format("{}:{}", status.st_dev, status.st_ino);
}

bool can_write(const fs::path &file, std::error_code &failure) {
  return has_access(file, W_OK, failure);
}

bool can_fill(const fs::path &folder, std::error_code &failure) {
  return has_access(folder, W_OK | X_OK, failure);
}

bool can_run(const fs::path &program) {
  return ::access(program.c_str(), X_OK) == 0;
}

void raise_open_file_limit() {
  rlimit descriptors{};
  if (::getrlimit(RLIMIT_NOFILE, &descriptors) != 0) return;
  descriptors.rlim_cur = descriptors.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &descriptors);
}

bool is_near_open_file_limit(std::FILE *file) {
  constexpr rlim_t kSpared = 64;
  rlimit descriptors{};
  return ::getrlimit(RLIMIT_NOFILE, &descriptors) == 0 &&
         rlim_t(::fileno(file)) + kSpared > descriptors.rlim_cur;
}

}  // namespace isowave::core::platform
