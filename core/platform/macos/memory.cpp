#include "core/platform/memory.hpp"

#include <malloc/malloc.h>
#include <sys/mman.h>
#include <sys/sysctl.h>
#include <unistd.h>

#include "core/platform/last_failure.hpp"

namespace isowave::core::platform {

namespace {

constexpr int kPrivate = MAP_PRIVATE | MAP_ANON;

/// Returns what the system's call did, or nullptr and why.
void *mapped_or_null(void *result, std::error_code &failure) {
  const bool failed = result == MAP_FAILED;
  failure = failed ? last_failure() : std::error_code();
  return failed ? nullptr : result;
}

}  // namespace

std::uint64_t page_bytes() {
  static const auto bytes = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return bytes;
}

std::uint64_t host_memory() {
  std::uint64_t bytes = 0;
  std::size_t size = sizeof(bytes);
  return ::sysctlbyname("hw.memsize", &bytes, &size, nullptr, 0) == 0 ? bytes : 0;
}

bool has_address_space(std::size_t bytes) {
  std::error_code failure;
  void *const room = mapped_or_null(::mmap(nullptr, bytes, PROT_NONE, kPrivate, -1, 0), failure);
  return room != nullptr && ::munmap(room, bytes) == 0;
}

/// The system promises no memory for pages that are not written to.
void *take_pages(std::size_t bytes, PageUse, std::error_code &failure) {
  return mapped_or_null(::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, kPrivate, -1, 0), failure);
}

/// New pages in their place: madvise() would leave what was written.
void clear_pages(void *pages, std::size_t bytes, std::error_code &failure) {
  mapped_or_null(::mmap(pages, bytes, PROT_READ | PROT_WRITE, kPrivate | MAP_FIXED, -1, 0),
                 failure);
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
  ::malloc_zone_pressure_relief(nullptr, 0);
}

}  // namespace isowave::core::platform
