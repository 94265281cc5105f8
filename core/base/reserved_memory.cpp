#include "core/base/reserved_memory.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/base/error.hpp"

namespace isowave::core {

ReservedMemory::ReservedMemory(std::uint64_t num_bytes) : num_bytes_(num_bytes) {
  if (num_bytes == 0) return;
  void *const data = ::mmap(nullptr, num_bytes, PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (data == MAP_FAILED)
    throw Error("the system refuses {} MiB of address space: {}", num_bytes >> 20,
                std::strerror(errno));
  data_ = data;
  // A huge page would take 2 MiB where one of 4 KiB is written to. Systems without huge pages
  // refuse this, and may.
  ::madvise(data_, num_bytes_, MADV_NOHUGEPAGE);
}

ReservedMemory::~ReservedMemory() {
  if (data_ != nullptr) ::munmap(data_, num_bytes_);
}

void ReservedMemory::release() {
  if (data_ != nullptr && ::madvise(data_, num_bytes_, MADV_DONTNEED) != 0)
    throw Error("the system does not take memory back: {}", std::strerror(errno));
}

std::uint64_t ReservedMemory::page_bytes() {
  static const auto bytes = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return bytes;
}

}  // namespace isowave::core
