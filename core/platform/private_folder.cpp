#include "core/platform/private_folder.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fstream>
#include <optional>
#include <system_error>

#include "core/platform/names_in.hpp"

namespace isowave::core::platform {

namespace fs = std::filesystem;

namespace {

constexpr int kMostLinks = 40;  ///< as many as Linux follows
constexpr mode_t kOthersWrite = S_IWGRP | S_IWOTH, kOthersEnter = S_IXGRP | S_IXOTH;
constexpr uid_t kUnmappedUser = 65534;  ///< what Linux shows for users that a container lacks

/// Whether this is a container that maps this user alone (Apptainer), so root's folders are shown
/// as those of kUnmappedUser.
bool root_is_unmapped() {
  std::ifstream map("/proc/self/uid_map");
  unsigned long inside = 0, outside = 0, count = 0;
  bool is_known = false;
  while (map >> inside >> outside >> count) {
    is_known = true;
    if (inside == 0) return false;
  }
  return is_known;
}

bool is_own(const struct stat &status) {
  return status.st_uid == ::geteuid() || status.st_uid == 0;
}

bool is_trusted(const struct stat &status) {
  static const bool unmapped = root_is_unmapped();
  return is_own(status) || (unmapped && status.st_uid == kUnmappedUser);
}

std::string of_another_user(const fs::path &path) {
  return fmt::format("{} belongs to another user", path.string());
}
std::string open_to_others(const fs::path &path) {
  return fmt::format("other users can write to {}", path.string());
}

/// can_enter: whether other users can reach what is in the folder.
std::string danger_within(const fs::path &folder, bool can_enter) {
  for (const std::string &name : names_in(folder)) {
    const fs::path path = folder / name;
    struct stat status {};
    if (::lstat(path.c_str(), &status) != 0) continue;  // another process has removed it
    if (!is_own(status)) return of_another_user(path);
    if (S_ISLNK(status.st_mode)) return fmt::format("{} is a symbolic link", path.string());
    if (can_enter && (status.st_mode & kOthersWrite) != 0) return open_to_others(path);
    if (!S_ISDIR(status.st_mode)) continue;
    std::string danger = danger_within(path, can_enter && (status.st_mode & kOthersEnter) != 0);
    if (!danger.empty()) return danger;
  }
  return {};
}

std::deque<fs::path> parts_of(const fs::path &path) {
  const fs::path relative = path.relative_path();
  return {relative.begin(), relative.end()};
}

/// A path from the root on, one part after the other.
class Walk {
 public:
  explicit Walk(const fs::path &path) : rest_(parts_of(path)) {
    ::stat("/", &status_);
    if (!is_trusted(status_)) danger_ = of_another_user("/");
  }

  FolderCheck run() {
    while (!rest_.empty() && danger_.empty() && !is_missing_) {
      const fs::path part = rest_.front();
      rest_.pop_front();
      if (part.empty() || part == ".") continue;
      if (part == "..") {
        path_ = path_.parent_path();
        ::lstat(path_.c_str(), &status_);
      } else {
        enter(path_ / part);
      }
    }
    for (const fs::path &part : rest_) {
      if (part == ".." && danger_.empty())  // where that leads is known when the folder is there
        danger_ = fmt::format("{} is missing", path_.string());
      path_ /= part;
    }
    if (danger_.empty() && !is_missing_ && S_ISDIR(status_.st_mode)) {
      if (!is_own(status_)) danger_ = of_another_user(path_);
      if ((status_.st_mode & kOthersWrite) != 0) danger_ = open_to_others(path_);
      if (danger_.empty()) danger_ = danger_within(path_, (status_.st_mode & kOthersEnter) != 0);
    }
    return {path_, danger_};
  }

 private:
  void enter(const fs::path &next) {
    const bool is_open = (status_.st_mode & kOthersWrite) != 0;
    if (is_open && (status_.st_mode & S_ISVTX) == 0) {
      danger_ = open_to_others(path_);
      return;
    }
    struct stat status {};
    int failed = ::lstat(next.c_str(), &status);
    if (failed != 0 && errno == ENOENT && is_open) {
      ::mkdir(next.c_str(), 0700);
      failed = ::lstat(next.c_str(), &status);
    }
    if (failed != 0) {
      if (is_open) danger_ = open_to_others(path_);  // they can make it before this user does
      is_missing_ = true;
      path_ = next;
    } else if (!is_trusted(status)) {
      danger_ = of_another_user(next);
    } else if (S_ISLNK(status.st_mode)) {
      follow(next);
    } else {
      path_ = next;
      status_ = status;
      is_missing_ = !S_ISDIR(status.st_mode);
    }
  }

  void follow(const fs::path &link) {
    std::error_code failure;
    const fs::path target = fs::read_symlink(link, failure);
    if (failure || ++num_links_ > kMostLinks) {
      is_missing_ = true;
      path_ = link;
      return;
    }
    if (target.is_absolute()) {
      path_ = "/";
      ::stat("/", &status_);
    }
    const std::deque<fs::path> parts = parts_of(target);
    rest_.insert(rest_.begin(), parts.begin(), parts.end());
  }

  fs::path path_ = "/";    ///< up to where the walk has come, without links
  struct stat status_ {};  ///< of path_
  std::deque<fs::path> rest_;
  std::string danger_;
  bool is_missing_ = false;  ///< path_ is not there, or no folder
  int num_links_ = 0;
};

/// Makes the folder if it is missing. Returns its path, or nothing.
std::optional<fs::path> make_or_take(const fs::path &folder) {
  FolderCheck check = check_private(folder);
  if (!check.danger.empty()) return {};
  ::mkdir(check.path.c_str(), 0700);
  std::error_code failure;
  if (!fs::is_directory(check.path, failure)) return {};
  return std::move(check.path);
}

}  // namespace

FolderCheck check_private(const fs::path &folder) {
  std::error_code failure;
  const fs::path path = fs::absolute(folder, failure);
  if (failure) return {folder, ""};  // the working folder is gone, so nothing can be written there
  return Walk(path).run();
}

fs::path make_private(const fs::path &parent, const std::string &name) {
  if (const auto folder = make_or_take(parent / name)) return *folder;
  for (const std::string &other : names_in(parent)) {
    if (!other.starts_with(name + ".")) continue;
    if (const auto folder = make_or_take(parent / other)) return *folder;
  }
  std::string fresh = (parent / (name + ".XXXXXX")).string();
  if (::mkdtemp(fresh.data()) == nullptr) return {};
  if (const auto folder = make_or_take(fresh)) return *folder;
  ::rmdir(fresh.c_str());
  return {};
}

}  // namespace isowave::core::platform
