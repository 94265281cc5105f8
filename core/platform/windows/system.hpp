#pragma once
// What the files for Windows have in common: errors, and handles of Windows.

#include <windows.h>

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

namespace isowave::core::platform {

/// GetLastError() as an error of the C library, if there is such an error: its text is then the
/// same as on other systems.
inline std::error_code last_system_failure() {
  const std::error_code code(static_cast<int>(::GetLastError()), std::system_category());
  const std::error_condition condition = code.default_error_condition();
  if (condition.category() != std::generic_category()) return code;
  return {condition.value(), std::generic_category()};
}

/// A handle; closed when this is destroyed.
class Handle {
 public:
  Handle() = default;
  explicit Handle(HANDLE handle) : handle_(handle) {}
  ~Handle() {
    if (is_open()) ::CloseHandle(handle_);
  }
  Handle(const Handle &) = delete;
  Handle &operator=(const Handle &) = delete;

  bool is_open() const { return handle_ != INVALID_HANDLE_VALUE && handle_ != nullptr; }
  HANDLE get() const { return handle_; }
  HANDLE *out() { return &handle_; }
  HANDLE release() { return std::exchange(handle_, INVALID_HANDLE_VALUE); }

 private:
  HANDLE handle_ = INVALID_HANDLE_VALUE;
};

/// Other processes may read, write, rename and remove what is open, as on other systems.
inline constexpr DWORD kShareAll = FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE;

/// Paths hold UTF-16, and std::string UTF-8: libstdc++ converts one to the other (process.cpp).
inline std::string utf8_of(const wchar_t *text) {
  return std::filesystem::path(text).string();
}

}  // namespace isowave::core::platform
