#include "core/io/input_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "core/base/error.hpp"

namespace isowave::core {

InputFile::InputFile(const std::filesystem::path &path, std::string what)
    : path_(path), what_(std::move(what)) {
  descriptor_ =
      ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe's would wait for a writer
  if (descriptor_ < 0) {
    if (errno == ENOENT) throw Error("{}: no such file", what_);
    throw Error("{}: cannot open: {}", what_, std::strerror(errno));
  }
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor_);
    throw Error("{}: not a regular file", what_);
  }
  size_ = std::uint64_t(status.st_size);
}

InputFile::~InputFile() {
  ::close(descriptor_);
}

void InputFile::read(std::uint64_t offset, std::span<std::byte> out) const {
  while (!out.empty()) {
    const ::ssize_t count = ::pread(descriptor_, out.data(), out.size(), ::off_t(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw Error("{}: cannot read: {}", what_, std::strerror(errno));
    if (count == 0) {
      struct stat now {};
      ::fstat(descriptor_, &now);
      throw Error("{}: truncated while it was in use: {} bytes were there, now {}", what_, size_,
                  now.st_size);
    }
    offset += std::uint64_t(count);
    out = out.subspan(std::size_t(count));
  }
}

void check_input_file(const std::filesystem::path &path) {
  InputFile{path};
}

}  // namespace isowave::core
