#include "core/io/atomic_file.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <stdexcept>
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

/// Gives a new file the mode of the file that it will replace, and its owner, group and access list
/// as far as this user may. Does nothing if there is no such file.
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
  folder_ = target_.has_parent_path() ? target_.parent_path() : ".";
  if (const OutputGroup *group = OutputGroup::current()) folder_ = group->place_of(folder_);
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
  temporary_ = folder_ / fmt::format(".isowave.{}.{}.tmp", ::getpid(), next_id.fetch_add(1));
}

int AtomicFile::open_temporary() {
#ifdef O_TMPFILE
  // commit() names the file through /proc.
  if (::access("/proc/self/fd", X_OK) == 0) {
    const int fd = ::open(folder_.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0666);
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

AtomicFile::AtomicFile(AtomicFile &&other) noexcept
    : target_(std::move(other.target_)),
      folder_(std::move(other.folder_)),
      temporary_(std::move(other.temporary_)),
      old_(std::move(other.old_)),
      file_(std::exchange(other.file_, nullptr)),
      nameless_(other.nameless_),
      in_place_(other.in_place_) {
  other.temporary_.clear();
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
  if (OutputGroup *group = OutputGroup::current()) return group->take(std::move(*this));
  close();
  replace_target(false);
}

fs::path AtomicFile::name_on_this_system() const {
  return fmt::format("/proc/{}/fd/{}", ::getpid(), ::fileno(file_));
}

fs::path AtomicFile::name_anywhere() {
  give_name();
  return fs::absolute(temporary_);
}

void AtomicFile::give_name() {
  if (!nameless_) return;
  const std::string self = name_on_this_system().string();
  int failed = 0;
  do {
    choose_temporary_name();
    failed = ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, temporary_.c_str(), AT_SYMLINK_FOLLOW);
  } while (failed != 0 && errno == EEXIST);
  if (failed != 0) fail(target_, errno);
  nameless_ = false;
}

void AtomicFile::close() {
  if (file_ == nullptr) return;
  give_name();
  if (std::fclose(std::exchange(file_, nullptr)) != 0) fail(target_, errno);
}

void AtomicFile::replace_target(bool keep_old) {
  struct stat status {};
  if (keep_old && ::stat(target_.c_str(), &status) == 0 && S_ISREG(status.st_mode)) {
    // By a second name, so that the first shows a whole file at any time. Some file systems give no
    // file two names.
    fs::path old = temporary_.string() + ".old";
    if (::link(target_.c_str(), old.c_str()) != 0 && std::rename(target_.c_str(), old.c_str()) != 0)
      fail(target_, errno);
    old_ = std::move(old);
  }
  if (std::rename(temporary_.c_str(), target_.c_str()) != 0) fail(target_, errno);
  temporary_.clear();
  in_place_ = true;
}

void AtomicFile::put_back() noexcept {
  if (!old_.empty()) {
    std::rename(old_.c_str(), target_.c_str());
    ::unlink(old_.c_str());  // rename() leaves two names of one file as they are
    old_.clear();
  } else if (in_place_) {
    ::unlink(target_.c_str());
  }
  in_place_ = false;
}

void AtomicFile::remove_old() noexcept {
  if (!old_.empty()) ::unlink(old_.c_str());
  old_.clear();
}

OutputGroup *OutputGroup::current_group = nullptr;

OutputGroup::OutputGroup() {
  if (current_group != nullptr) throw std::logic_error("there is an OutputGroup already");
  current_group = this;
  // Every file without a name keeps its descriptor.
  rlimit descriptors{};
  if (::getrlimit(RLIMIT_NOFILE, &descriptors) != 0) return;
  descriptors.rlim_cur = descriptors.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &descriptors);
}

OutputGroup::~OutputGroup() {
  current_group = nullptr;
  files_.clear();
  std::for_each(folders_.rbegin(), folders_.rend(),
                [](const fs::path &folder) { ::rmdir(folder.c_str()); });
}

fs::path OutputGroup::place_of(const fs::path &folder) const {
  if (std::ranges::find(new_folders_, folder / "") == new_folders_.end()) return folder;
  fs::path place = folder;
  std::error_code failure;
  while (place.has_parent_path() && !fs::exists(place, failure)) place = place.parent_path();
  return fs::exists(place, failure) ? place : fs::path(".");
}

void OutputGroup::make_folders(const fs::path &folder) {
  fs::path made;
  for (const fs::path &part : folder) {
    made /= part;
    std::error_code failure;
    if (fs::exists(made, failure)) continue;
    folders_.push_back(made);
    if (!fs::create_directory(made, failure)) folders_.pop_back();
    if (failure) throw Error("cannot make the folder {}: {}", folder.string(), failure.message());
  }
}

void OutputGroup::take(AtomicFile &&file) {
  files_.push_back(std::unique_ptr<AtomicFile>(new AtomicFile(std::move(file))));
  // A system with few descriptors keeps some for the files at work.
  constexpr rlim_t kSpared = 64;
  rlimit descriptors{};
  if (::getrlimit(RLIMIT_NOFILE, &descriptors) == 0 &&
      rlim_t(::fileno(files_.back()->file_)) + kSpared > descriptors.rlim_cur)
    files_.back()->close();
}

void OutputGroup::commit() {
  try {
    for (const fs::path &folder : new_folders_) make_folders(folder);
    for (const auto &file : files_) file->close();
    const bool alone = files_.size() == 1;
    for (const auto &file : files_) file->replace_target(!alone);
  } catch (...) {
    std::for_each(files_.rbegin(), files_.rend(), [](const auto &file) { file->put_back(); });
    throw;
  }
  for (const auto &file : files_) file->remove_old();
  files_.clear();
  folders_.clear();
}

std::uint64_t OutputGroup::bytes_of(const fs::path &path) const {
  for (const auto &file : files_) {
    if (file->target_ != follow_links(path)) continue;
    struct stat status {};
    const bool known = file->file_ != nullptr ? ::fstat(::fileno(file->file_), &status) == 0
                                              : ::stat(file->temporary_.c_str(), &status) == 0;
    if (known) return static_cast<std::uint64_t>(status.st_size);
  }
  return fs::file_size(path);
}

}  // namespace isowave::core
