#include "core/platform/streams.hpp"

#include <fcntl.h>
#include <io.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>

#include "core/platform/windows/system.hpp"

namespace isowave::core::platform {

namespace {

constexpr int kOutput = 1, kErrors = 2;
int loud_errors = kErrors;

int open_nowhere() {
  return ::_wopen(L"NUL", _O_WRONLY | _O_BINARY | _O_NOINHERIT);
}

bool write_to(int descriptor, std::string_view text) {
  return ::_write(descriptor, text.data(), static_cast<unsigned>(text.size())) >= 0;
}

}  // namespace

/// The C library opens none of them for another file. Their texts are in UTF-8, and lines end as on
/// other systems.
void open_standard_streams() {
  for (const int stream : {0, kOutput, kErrors}) {
    if (::_get_osfhandle(stream) >= 0) ::_setmode(stream, _O_BINARY);
  }
  static const UINT old_page = ::GetConsoleOutputCP();
  if (old_page == 0 || old_page == CP_UTF8) return;  // no console, or nothing to change
  ::SetConsoleOutputCP(CP_UTF8);
  std::atexit([] { ::SetConsoleOutputCP(old_page); });
}

bool errors_go_to_terminal() {
  return ::_isatty(kErrors) != 0;
}

bool write_error(std::string_view text) {
  return write_to(kErrors, text);
}

void fall_silent() {
  std::fflush(nullptr);
  if (const int copy = ::_dup(kErrors); copy >= 0) loud_errors = copy;
  const int nowhere = open_nowhere();
  if (nowhere < 0) return;
  ::_dup2(nowhere, kOutput);
  ::_dup2(nowhere, kErrors);
  ::_close(nowhere);
}

bool write_error_aloud(std::string_view text) {
  return write_to(loud_errors, text);
}

HushedErrors::HushedErrors() : errors_(::_dup(kErrors)), nowhere_(open_nowhere()) {
  if (errors_ >= 0 && nowhere_ >= 0) ::_dup2(nowhere_, kErrors);
}

HushedErrors::~HushedErrors() {
  const int error_number = errno;
  if (errors_ >= 0) ::_dup2(errors_, kErrors);
  for (const int file : {errors_, nowhere_}) {
    if (file >= 0) ::_close(file);
  }
  errno = error_number;
}

}  // namespace isowave::core::platform
