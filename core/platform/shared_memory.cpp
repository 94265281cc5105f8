#include "core/platform/shared_memory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "core/platform/provide_memory.hpp"

namespace isowave::core::platform {

namespace {

/// Returns nullptr if that fails. Closes the descriptor.
void *map_and_close(int file, std::size_t bytes) {
  void *const data = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  ::close(file);
  return data == MAP_FAILED ? nullptr : data;  // NOLINT(performance-no-int-to-ptr)
}

}  // namespace

SharedMemory SharedMemory::make(std::size_t bytes) {
  SharedMemory memory;
  int file = -1;
  unsigned id = 0;
  do {  // another user may have taken a name
    memory.name_ = fmt::format("/isowave.{}.{}", ::getpid(), id++);
    file = ::shm_open(memory.name_.c_str(), O_CREAT | O_EXCL | O_RDWR, 0600);
  } while (file < 0 && errno == EEXIST);
  if (file < 0) return memory;
  if (!provide_memory(file, bytes)) {
    ::close(file);
  } else {
    memory.data_ = map_and_close(file, bytes);
    memory.bytes_ = bytes;
  }
  if (memory.data_ == nullptr) memory.remove_name();
  return memory;
}

SharedMemory SharedMemory::open(const std::string &name, std::size_t bytes) {
  SharedMemory memory;
  memory.name_ = name;
  const int file = ::shm_open(name.c_str(), O_RDWR, 0);
  if (file < 0) return memory;
  memory.data_ = map_and_close(file, bytes);
  memory.bytes_ = bytes;
  return memory;
}

SharedMemory::~SharedMemory() {
  if (data_ != nullptr) ::munmap(data_, bytes_);
}

SharedMemory::SharedMemory(SharedMemory &&other) noexcept {
  *this = std::move(other);
}

SharedMemory &SharedMemory::operator=(SharedMemory &&other) noexcept {
  std::swap(name_, other.name_);
  std::swap(data_, other.data_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

void SharedMemory::remove_name() {
  ::shm_unlink(name_.c_str());
}

}  // namespace isowave::core::platform
