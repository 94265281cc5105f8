#include "core/io/file_bytes.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/error.hpp"

namespace isowave {

FileBytes::FileBytes(const std::filesystem::path &path)
    : path_(path), descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  if (descriptor_ < 0) throw Error("{}: cannot open: {}", path.string(), std::strerror(errno));
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor_);
    throw Error("{}: cannot open: not a regular file", path.string());
  }
  size_ = std::uint64_t(status.st_size);
}

FileBytes::~FileBytes() {
  ::close(descriptor_);
}

void FileBytes::read(std::uint64_t offset, std::span<std::byte> out) const {
  while (!out.empty()) {
    const ::ssize_t count = ::pread(descriptor_, out.data(), out.size(), ::off_t(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw Error("{}: cannot read: {}", path_.string(), std::strerror(errno));
    if (count == 0) {
      throw Error("{}: truncated while it was in use: {} bytes were there, now {}", path_.string(), size_,
                  offset);
    }
    offset += std::uint64_t(count);
    out = out.subspan(std::size_t(count));
  }
}

}  // namespace isowave
