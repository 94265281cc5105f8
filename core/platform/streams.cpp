#include "core/platform/streams.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace isowave::core::platform {

namespace {

int loud_errors = STDERR_FILENO;

int open_nowhere() {
  return ::open("/dev/null", O_WRONLY | O_CLOEXEC);
}

bool write_to(int descriptor, std::string_view text) {
  return ::write(descriptor, text.data(), text.size()) >= 0;
}

}  // namespace

void open_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    // In the wrong direction, so that its use fails.
    if (::fcntl(stream, F_GETFD) == -1 && errno == EBADF)
      ::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
  }
}

bool errors_go_to_terminal() {
  return ::isatty(STDERR_FILENO) != 0;
}

bool write_error(std::string_view text) {
  return write_to(STDERR_FILENO, text);
}

void fall_silent() {
  std::fflush(nullptr);
  if (const int copy = ::dup(STDERR_FILENO); copy >= 0) loud_errors = copy;
  const int nowhere = open_nowhere();
  if (nowhere < 0) return;
  ::dup2(nowhere, STDOUT_FILENO);
  ::dup2(nowhere, STDERR_FILENO);
  ::close(nowhere);
}

bool write_error_aloud(std::string_view text) {
  return write_to(loud_errors, text);
}

HushedErrors::HushedErrors() : errors_(::dup(STDERR_FILENO)), nowhere_(open_nowhere()) {
  if (errors_ >= 0 && nowhere_ >= 0) ::dup2(nowhere_, STDERR_FILENO);
}

HushedErrors::~HushedErrors() {
  const int error_number = errno;
  if (errors_ >= 0) ::dup2(errors_, STDERR_FILENO);
  for (const int file : {errors_, nowhere_}) {
    if (file >= 0) ::close(file);
  }
  errno = error_number;
}

}  // namespace isowave::core::platform
