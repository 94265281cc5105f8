#include "core/platform/process.hpp"

#include <execinfo.h>
#include <pthread.h>
#include <pwd.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <vector>

namespace isowave::core::platform {

std::uint64_t user_id() {
  return ::geteuid();
}

std::uint64_t process_id() {
  return static_cast<std::uint64_t>(::getpid());
}

std::optional<std::filesystem::path> home_by_list() {
  std::vector<char> text(1 << 16);
  passwd entry{}, *found = nullptr;
  if (::getpwuid_r(::getuid(), &entry, text.data(), text.size(), &found) != 0 || found == nullptr)
    return {};
  return entry.pw_dir;
}

void make_utf8(int &, char **&) {}

void set_environment(const char *name, const char *value) {
  ::setenv(name, value, 1);
}

void unset_environment(const char *name) {
  ::unsetenv(name);
}

void call_in_forks(void (*call)()) {
  ::pthread_atfork(nullptr, nullptr, call);
}

void load_unwinder() {
  std::array<void *, 1> frames{};
  ::backtrace(frames.data(), frames.size());
}

}  // namespace isowave::core::platform
