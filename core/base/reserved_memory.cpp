#include "core/base/reserved_memory.hpp"

#include <system_error>

#include "core/base/error.hpp"
#include "core/platform/memory.hpp"

namespace isowave::core {

ReservedMemory::ReservedMemory(std::uint64_t num_bytes) : num_bytes_(num_bytes) {
  if (num_bytes == 0) return;
  std::error_code failure;
  data_ = platform::take_pages(num_bytes, platform::PageUse::kFew, failure);
  if (failure)
    throw Error("the system refuses {} MiB of address space: {}", num_bytes >> 20,
                failure.message());
}

ReservedMemory::~ReservedMemory() {
  if (data_ != nullptr) platform::free_pages(data_, num_bytes_);
}

void ReservedMemory::release() {
  if (data_ == nullptr) return;
  std::error_code failure;
  platform::clear_pages(data_, num_bytes_, failure);
  if (failure) throw Error("the system does not take memory back: {}", failure.message());
}

}  // namespace isowave::core
