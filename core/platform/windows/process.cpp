#include "core/platform/process.hpp"

#include <cstdint>
#include <cstdlib>
#include <cwchar>
#include <string>
#include <vector>

#include "core/platform/windows/system.hpp"
// After windows.h.
#include <shellapi.h>

/// The next UTF-16 unit of a text in UTF-8, in place of the C library's function. libstdc++ makes
/// paths of std::string by it alone, and the C library's takes each byte for a letter.
///
/// state    the second unit of a letter that has two; 0: there is none
/// Returns  how many bytes it has read; -1: they are no UTF-8; -2: bytes are missing
extern "C" std::size_t mbrtowc(wchar_t *to, const char *from, std::size_t size,
                               std::mbstate_t *state) {
  constexpr auto kWrong = static_cast<std::size_t>(-1), kTooFew = static_cast<std::size_t>(-2);
  if (from == nullptr) return 0;
  if (size == 0) return kTooFew;
  const auto *const bytes = reinterpret_cast<const unsigned char *>(from);
  if (state != nullptr && *state != 0) {  // the letter's last byte
    if (to != nullptr) *to = static_cast<wchar_t>(*state);
    *state = 0;
    return 1;
  }
  const unsigned first = bytes[0];
  const std::size_t count = first < 0x80 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
  if ((first >= 0x80 && first < 0xC2) || first > 0xF4) return kWrong;
  if (size < count) return kTooFew;
  std::uint32_t letter = count == 1 ? first : first & (0x7Fu >> count);
  for (std::size_t i = 1; i < count; ++i) {
    if ((bytes[i] & 0xC0u) != 0x80) return kWrong;
    letter = letter << 6 | (bytes[i] & 0x3Fu);
  }
  if (count < 4) {
    if (to != nullptr) *to = static_cast<wchar_t>(letter);
    return letter == 0 ? 0 : count;
  }
  if (letter < 0x10000 || letter > 0x10FFFF || state == nullptr) return kWrong;
  letter -= 0x10000;
  if (to != nullptr) *to = static_cast<wchar_t>(0xD800 + (letter >> 10));
  *state = static_cast<std::mbstate_t>(0xDC00 + (letter & 0x3FF));
  return 3;
}

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
