#include "core/io/atomic_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "core/base/error.hpp"

namespace isowave::core {
namespace fs = std::filesystem;

namespace {

[[noreturn]] void fail(const fs::path &target, int error_number) {
  throw Error("{}: cannot write: {}", target.string(), std::strerror(error_number));
}

}  // namespace

fs::path follow_links(const fs::path &path) {
  constexpr int kMostLinks = 40;  // as many as Linux follows
  fs::path target = path;
  for (int i = 0; i < kMostLinks; ++i) {
    std::error_code failure;
    const fs::path next = fs::read_symlink(target, failure);
    if (failure) return target;
    target = next.is_absolute() ? next : target.parent_path() / next;
  }
  fail(path, ELOOP);
}

void keep_permissions(const fs::path &replaced, int file) {
  struct stat old {
  }, made{};
  if (::stat(replaced.c_str(), &old) != 0 || ::fstat(file, &made) != 0) return;
  mode_t mode = old.st_mode & 0777;
  constexpr auto kSameUser = static_cast<uid_t>(-1);
  constexpr auto kSameGroup = static_cast<gid_t>(-1);
  if (old.st_gid != made.st_gid && ::fchown(file, kSameUser, old.st_gid) != 0)
    mode &= ~static_cast<mode_t>(S_IRWXG);  // they would be the rights of another group
  // Only root can give a file away: an ordinary user becomes the owner.
  if (old.st_uid != made.st_uid && ::fchown(file, old.st_uid, kSameGroup) != 0) errno = 0;
  // Before the mode, which then also limits what the list grants.
  constexpr const char *kAccessList = "system.posix_acl_access";
  std::array<char, 1 << 12> list{};
  const ssize_t length = ::getxattr(replaced.c_str(), kAccessList, list.data(), list.size());
  if (length > 0) ::fsetxattr(file, kAccessList, list.data(), static_cast<std::size_t>(length), 0);
  ::fchmod(file, mode);
}

AtomicFile::AtomicFile(const fs::path &target) : target_(follow_links(target)) {
  if (target_.filename().empty()) throw Error("'{}': cannot write: no file name", target.string());
  struct stat status {};
  if (::stat(target_.c_str(), &status) == 0) {
    // rename() would replace a device such as /dev/null, and fails on a folder only after all the
    // work.
    if (!S_ISREG(status.st_mode))
      throw Error("{}: cannot write: it exists and is not a regular file", target.string());
    // It would replace a file that is not to be written, too.
    if (::access(target_.c_str(), W_OK) != 0) fail(target, errno);
  } else if (errno != ENOENT) {
    fail(target, errno);
  }
  const int fd = open_temporary();
  if (fd < 0) fail(target_, errno);
  keep_permissions(target_, fd);
  file_ = ::fdopen(fd, "w+b");
  if (file_ == nullptr) {
    const int error_number = errno;
    ::close(fd);
    if (!nameless_) ::unlink(temporary_.c_str());
    fail(target_, error_number);
  }
}

void AtomicFile::choose_temporary_name() {
  static std::atomic<unsigned> next_id{0};
  // Not of the target's name, which may be as long as names may be.
  temporary_ =
      target_.parent_path() / fmt::format(".isowave.{}.{}.tmp", ::getpid(), next_id.fetch_add(1));
}

int AtomicFile::open_temporary() {
#ifdef O_TMPFILE
  // commit() names the file through /proc.
  if (::access("/proc/self/fd", X_OK) == 0) {
    const fs::path folder = target_.has_parent_path() ? target_.parent_path() : ".";
    const int fd = ::open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0666);
    nameless_ = fd >= 0;
    if (nameless_) return fd;
  }
#endif
  for (;;) {  // a killed process of the same number may have left such a file
    choose_temporary_name();
    const int fd = ::open(temporary_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd >= 0 || errno != EEXIST) return fd;
  }
}

AtomicFile::~AtomicFile() {
  if (file_ != nullptr) std::fclose(file_);
  if (!nameless_ && !temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::write(std::span<const std::byte> bytes) {
  if (bytes.empty()) return;  // their address may be null, which fwrite() does not want
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) fail(target_, errno);
}

void AtomicFile::read_back(const std::function<void(std::span<const std::byte>)> &take) {
  errno = 0;
  if (std::ferror(file_) != 0 || ::fseeko(file_, 0, SEEK_SET) != 0)
    fail(target_, errno != 0 ? errno : EIO);
  std::vector<std::byte> piece(1u << 16);
  while (const std::size_t count = std::fread(piece.data(), 1, piece.size(), file_))
    take(std::span(piece).first(count));
  if (std::ferror(file_) != 0) fail(target_, errno != 0 ? errno : EIO);
}

void AtomicFile::commit() {
  errno = 0;
  if (std::ferror(file_) != 0 || std::fflush(file_) != 0) fail(target_, errno != 0 ? errno : EIO);
  if (nameless_) {
    const std::string self = fmt::format("/proc/self/fd/{}", ::fileno(file_));
    int failed = 0;
    do {
      choose_temporary_name();
      failed = ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, temporary_.c_str(), AT_SYMLINK_FOLLOW);
    } while (failed != 0 && errno == EEXIST);
    if (failed != 0) fail(target_, errno);
    nameless_ = false;
  }
  if (std::fclose(std::exchange(file_, nullptr)) != 0) fail(target_, errno);
  if (std::rename(temporary_.c_str(), target_.c_str()) != 0) fail(target_, errno);
  temporary_.clear();
}

}  // namespace isowave::core
