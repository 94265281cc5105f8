#pragma once
// The memory of this process and of its host, as the system gives it.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <system_error>

namespace isowave::core::platform {

/// Whether memory that is taken costs nothing until it is written to.
#ifdef __EMSCRIPTEN__
inline constexpr bool kHasPages = false;
#else
inline constexpr bool kHasPages = true;
#endif
/// Bytes of a page, by which the system provides memory.
std::uint64_t page_bytes();
/// Bytes of the host's memory, used or not; 0 if the system does not say.
std::uint64_t host_memory();
/// Whether this process could get that much address space more.
bool has_address_space(std::size_t bytes);

enum class PageUse : std::uint8_t {
  kMost,  ///< the caller will write to most pages
  kFew,   ///< the caller will write to few pages; the system need not have memory for the others
};

/// Takes pages of zeros. The system provides a page when it is written to first.
///
/// bytes    > 0
/// Returns  nullptr if the system refuses; `failure` then says why
void *take_pages(std::size_t bytes, PageUse use, std::error_code &failure);
/// Gives the memory of pages back. What was written is zeros again.
void clear_pages(void *pages, std::size_t bytes, std::error_code &failure);
/// Gives pages back that take_pages() returned, all of them.
void free_pages(void *pages, std::size_t bytes) noexcept;

/// Shows the first bytes of a file as memory, read-only. The file keeps its length while it is
/// shown: a process that touches what is missing ends.
///
/// bytes    > 0
/// Returns  nullptr if the system refuses; `failure` then says why
const void *map_file(std::FILE *file, std::size_t bytes, std::error_code &failure);
void unmap_file(const void *mapped, std::size_t bytes) noexcept;

/// Gives the system back what the process has freed.
void give_back_heap();

}  // namespace isowave::core::platform
