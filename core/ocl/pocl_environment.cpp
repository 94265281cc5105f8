#include "core/ocl/pocl_environment.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <string_view>
#include <system_error>

#include "core/ocl/environment.hpp"

namespace isowave::core::ocl {

namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t kNeededBytes = 64u << 20;  ///< kernels of one device, compiled, take less
constexpr std::size_t kLongestName =
    700;  ///< PoCL ends the process where names of files in it exceed 1,024 bytes

struct KernelFolder {
  std::string notice, trouble;
  bool has_pocl = false;
};

/// By PoCL 3.1's rule.
fs::path usual_folder() {
  if (const std::string folder = environment("POCL_CACHE_DIR"); !folder.empty()) return folder;
  if (const std::string cache = environment("XDG_CACHE_HOME"); !cache.empty())
    return cache + "/pocl/kcache";
  if (std::getenv("HOME") != nullptr) return environment("HOME") + "/.cache/pocl/kcache";
  return "/tmp/pocl/kcache";
}

/// Whether the folder could be filled, or made first. Makes nothing.
bool is_usable(const fs::path &given) {
  std::error_code failure;
  const fs::path wanted = fs::absolute(given, failure);
  fs::path folder = wanted;
  if (folder.string().size() > kLongestName) return false;
  while (folder.has_relative_path() &&
         fs::status(folder, failure).type() == fs::file_type::not_found) {
    if (fs::is_symlink(folder, failure)) return false;  // it leads nowhere
    folder = folder.parent_path();
  }
  if (!fs::is_directory(folder, failure) || ::access(folder.c_str(), W_OK | X_OK) != 0)
    return false;
  if (folder == wanted) {
    for (const auto &entry : fs::directory_iterator(
             folder, failure)) {  // another user may have made some: root, by sudo
      if (entry.is_directory(failure) && ::access(entry.path().c_str(), W_OK | X_OK) != 0)
        return false;
    }
  }
  const fs::space_info space = fs::space(folder, failure);
  return failure || space.available >= kNeededBytes;
}

/// Makes a folder that only this user can write to: what lies there is run as code. Returns whether
/// it is there.
bool make_private(const fs::path &folder) {
  ::mkdir(folder.c_str(), 0700);
  struct stat status {};
  return ::lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
         status.st_uid == ::geteuid() && (status.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

KernelFolder choose_folder() {
  if (environment("POCL_CACHE_DIR").empty())
    ::unsetenv("POCL_CACHE_DIR");  // PoCL ends the process where it is empty
  const fs::path usual = usual_folder();
  if (is_usable(usual)) return {};
  if (!environment("POCL_CACHE_DIR").empty()) {
    return {"", fmt::format("; PoCL cannot write to {}: set POCL_CACHE_DIR to another folder",
                            usual.string())};
  }
  for (const std::string &parent :
       {environment("TMPDIR"), std::string("/tmp"), std::string("/var/tmp")}) {
    const fs::path folder = fs::path(parent) / fmt::format("isowave-kernels-{}", ::geteuid());
    if (parent.empty() || !is_usable(folder) || !make_private(folder)) continue;
    ::setenv("POCL_CACHE_DIR", folder.c_str(), 1);
    return {fmt::format("PoCL cannot write to {}: compiled kernels go to {} (set POCL_CACHE_DIR "
                        "for another folder)",
                        usual.string(), folder.string()),
            ""};
  }
  return {"", fmt::format(
                  "; PoCL cannot write to {}, nor to /tmp: set POCL_CACHE_DIR to another folder",
                  usual.string())};
}

/// PoCL 3.1 runs the linker, and ends the process where PATH, empty for some services, does not
/// lead to it.
void complete_path() {
  const std::string path = environment("PATH");
  for (std::size_t begin = 0; begin < path.size();) {
    const std::size_t end = std::min(path.find(':', begin), path.size());
    if (::access((path.substr(begin, end - begin) + "/ld").c_str(), X_OK) == 0) return;
    begin = end + 1;
  }
  ::setenv("PATH", (path + (path.empty() ? "" : ":") + "/usr/local/bin:/usr/bin:/bin").c_str(), 1);
}

KernelFolder &state() {
  static KernelFolder chosen;
  return chosen;
}

}  // namespace

void prepare_for_pocl() {
  static std::once_flag once;
  std::call_once(once, [] {
    complete_path();
    state() = choose_folder();
  });
}

void note_pocl() {
  state().has_pocl = true;
}

std::string cache_notice() {
  return state().has_pocl ? state().notice : "";
}

std::string cache_trouble() {
  return state().trouble;
}

}  // namespace isowave::core::ocl
