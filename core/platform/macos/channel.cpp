#include "core/platform/channel.hpp"

#include <crt_externs.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>

namespace isowave::core::platform {

bool make_channel(std::array<int, 2> &ends) {
  if (::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()) != 0) return false;
  const int yes = 1;
  for (const int end : ends) {
    ::fcntl(end, F_SETFD, FD_CLOEXEC);
    ::setsockopt(end, SOL_SOCKET, SO_NOSIGPIPE, &yes, sizeof(yes));
  }
  return true;
}

std::ptrdiff_t write_to_channel(int end, std::span<const std::byte> bytes) {
  return ::send(end, bytes.data(), bytes.size(), 0);
}

int make_scratch() {
  char name[] = "/tmp/isowave_XXXXXX";
  const int file = ::mkstemp(name);
  if (file < 0) return file;
  ::unlink(name);
  ::fcntl(file, F_SETFD, FD_CLOEXEC);
  return file;
}

char **all_variables() {
  return *::_NSGetEnviron();
}

}  // namespace isowave::core::platform
