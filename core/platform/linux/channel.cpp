#include "core/platform/channel.hpp"

#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

namespace isowave::core::platform {

bool make_channel(std::array<int, 2> &ends) {
  return ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) == 0;
}

std::ptrdiff_t write_to_channel(int end, std::span<const std::byte> bytes) {
  return ::send(end, bytes.data(), bytes.size(), MSG_NOSIGNAL);
}

int make_scratch() {
  return ::memfd_create("isowave_errors", MFD_CLOEXEC);
}

char **all_variables() {
  return environ;
}

}  // namespace isowave::core::platform
