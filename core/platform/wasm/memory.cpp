#include "core/platform/memory.hpp"

#include <unistd.h>

#include <cstdlib>
#include <cstring>

#include "core/platform/last_failure.hpp"

namespace isowave::core::platform {

std::uint64_t page_bytes() {
  return 1u << 16;  // by which WebAssembly's memory grows
}

std::uint64_t host_memory() {
  return std::uint64_t{1} << 32;  // addresses have 32 bits
}

bool has_address_space(std::size_t bytes) {
  void *const room = std::malloc(bytes);
  std::free(room);
  return room != nullptr;
}

/// Memory has no pages that come when they are written to: all of it is taken, and cleared.
void *take_pages(std::size_t bytes, PageUse, std::error_code &failure) {
  void *const pages = std::calloc(bytes, 1);
  failure =
      pages == nullptr ? std::make_error_code(std::errc::not_enough_memory) : std::error_code();
  return pages;
}

void clear_pages(void *pages, std::size_t bytes, std::error_code &failure) {
  std::memset(pages, 0, bytes);
  failure = {};
}

void free_pages(void *pages, std::size_t) noexcept {
  std::free(pages);
}

/// A copy.
const void *map_file(std::FILE *file, std::size_t bytes, std::error_code &failure) {
  void *const copy = std::malloc(bytes);
  failure =
      copy == nullptr ? std::make_error_code(std::errc::not_enough_memory) : std::error_code();
  for (std::size_t done = 0; copy != nullptr && !failure && done < bytes;) {
    const ssize_t count = ::pread(::fileno(file), static_cast<std::byte *>(copy) + done,
                                  bytes - done, static_cast<off_t>(done));
    if (count <= 0)
      failure = count < 0 ? last_failure() : std::make_error_code(std::errc::io_error);
    done += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  if (!failure) return copy;
  std::free(copy);
  return nullptr;
}

void unmap_file(const void *mapped, std::size_t) noexcept {
  std::free(const_cast<void *>(mapped));
}

void give_back_heap() {}

}  // namespace isowave::core::platform
