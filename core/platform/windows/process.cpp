#include "core/platform/process.hpp"

#include <cstdlib>
#include <string>
#include <vector>

#include "core/platform/windows/system.hpp"
// After windows.h.
#include <shellapi.h>

namespace isowave::core::platform {

/// Folders for temporary files are each user's own.
std::uint64_t user_id() {
  return 0;
}

std::uint64_t process_id() {
  return ::GetCurrentProcessId();
}

std::optional<std::filesystem::path> home_by_list() {
  return {};
}

std::filesystem::path own_program() {
  std::wstring name(32768, L'\0');  // no path is longer
  const DWORD length = ::GetModuleFileNameW(nullptr, name.data(), static_cast<DWORD>(name.size()));
  name.resize(length < name.size() ? length : 0);
  return name;
}

/// main() gets them in a code page that lacks most letters.
void make_utf8(int &argc, char **&argv) {
  static std::vector<std::string> texts;
  static std::vector<char *> pointers;
  int count = 0;
  wchar_t **const wide = ::CommandLineToArgvW(::GetCommandLineW(), &count);
  if (wide == nullptr) return;
  for (int i = 0; i < count; ++i) texts.push_back(utf8_of(wide[i]));
  ::LocalFree(wide);
  for (std::string &text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  argc = count;
  argv = pointers.data();
}

void set_environment(const char *name, const char *value) {
  ::_putenv_s(name, value);
}

void unset_environment(const char *name) {
  ::_putenv_s(name, "");
}

/// Windows forks no process.
void call_in_forks(void (*)()) {}

void load_unwinder() {}

}  // namespace isowave::core::platform
