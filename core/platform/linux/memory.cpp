#include "core/platform/memory.hpp"

#include <malloc.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/platform/last_failure.hpp"

namespace isowave::core::platform {

namespace {

/// Returns what the system's call did, or nullptr and why.
void *mapped_or_null(void *result, std::error_code &failure) {
  const bool failed =
      result == MAP_FAILED;  // NOLINT(performance-no-int-to-ptr): the system's macro
  failure = failed ? last_failure() : std::error_code();
  return failed ? nullptr : result;
}

}  // namespace

std::uint64_t page_bytes() {
  static const auto bytes = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return bytes;
}

std::uint64_t host_memory() {
  const auto pages = ::sysconf(_SC_PHYS_PAGES), page_bytes = ::sysconf(_SC_PAGESIZE);
  return pages > 0 && page_bytes > 0 ? std::uint64_t(pages) * std::uint64_t(page_bytes) : 0;
}

bool has_address_space(std::size_t bytes) {
  std::error_code failure;
  void *const room = mapped_or_null(
      ::mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0),
      failure);
  return room != nullptr && ::munmap(room, bytes) == 0;
}

void *take_pages(std::size_t bytes, PageUse use, std::error_code &failure) {
  const int reserve = use == PageUse::kFew ? MAP_NORESERVE : 0;
  void *const pages = mapped_or_null(
      ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | reserve, -1, 0),
      failure);
  // A huge page would take 2 MiB if only 4 KiB of it are written to. Systems without huge pages
  // refuse this, and may.
  if (pages != nullptr && use == PageUse::kFew) ::madvise(pages, bytes, MADV_NOHUGEPAGE);
  return pages;
}

void clear_pages(void *pages, std::size_t bytes, std::error_code &failure) {
  failure = ::madvise(pages, bytes, MADV_DONTNEED) == 0 ? std::error_code() : last_failure();
}

void free_pages(void *pages, std::size_t bytes) noexcept {
  ::munmap(pages, bytes);
}

const void *map_file(std::FILE *file, std::size_t bytes, std::error_code &failure) {
  return mapped_or_null(::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, ::fileno(file), 0), failure);
}

void unmap_file(const void *mapped, std::size_t bytes) noexcept {
  ::munmap(const_cast<void *>(mapped), bytes);
}

void give_back_heap() {
  ::malloc_trim(0);
}

}  // namespace isowave::core::platform
