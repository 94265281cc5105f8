#include "core/base/host_memory.hpp"

#include <unistd.h>

namespace isowave::core {

std::uint64_t host_memory() {
  const auto pages = ::sysconf(_SC_PHYS_PAGES), page_bytes = ::sysconf(_SC_PAGESIZE);
  return pages > 0 && page_bytes > 0 ? std::uint64_t(pages) * std::uint64_t(page_bytes) : 0;
}

}  // namespace isowave::core
