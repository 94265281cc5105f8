#include "core/platform/process.hpp"

#include <cstdlib>

namespace isowave::core::platform {

std::uint64_t user_id() {
  return 0;
}

std::uint64_t process_id() {
  return 1;
}

std::optional<std::filesystem::path> home_by_list() {
  return {};
}

std::filesystem::path own_program() {
  return {};
}

void set_environment(const char *name, const char *value) {
  ::setenv(name, value, 1);
}

void unset_environment(const char *name) {
  ::unsetenv(name);
}

void call_in_forks(void (*)()) {}

void load_unwinder() {}

}  // namespace isowave::core::platform
