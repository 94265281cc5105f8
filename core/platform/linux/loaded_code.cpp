#include "core/platform/loaded_code.hpp"

#include <link.h>
#include <sys/mman.h>

#include <cstdint>

#include "core/platform/memory.hpp"

namespace isowave::core::platform {

namespace {

/// The loader says where things are by numbers.
void *at(std::uintptr_t address) {
  return reinterpret_cast<void *>(address);  // NOLINT(performance-no-int-to-ptr)
}

/// Whether the loader has written to its code: such pages are not those of the file.
bool has_changed_code(const dl_phdr_info &library) {
  for (int i = 0; i < library.dlpi_phnum; ++i) {
    if (library.dlpi_phdr[i].p_type != PT_DYNAMIC) continue;
    const auto *entry =
        static_cast<const ElfW(Dyn) *>(at(library.dlpi_addr + library.dlpi_phdr[i].p_vaddr));
    for (; entry->d_tag != DT_NULL; ++entry) {
      if (entry->d_tag == DT_TEXTREL) return true;
      if (entry->d_tag == DT_FLAGS && (entry->d_un.d_val & DF_TEXTREL) != 0) return true;
    }
  }
  return false;
}

/// Whole pages that no code can have written to. What the loader writes to and then protects lies
/// in segments that are writable by their headers.
int give_back_pages(dl_phdr_info *library, std::size_t, void *is_meant) {
  if (!(*static_cast<bool (**)(std::string_view)>(is_meant))(library->dlpi_name) ||
      has_changed_code(*library))
    return 0;
  const std::uintptr_t page = page_bytes();
  for (int i = 0; i < library->dlpi_phnum; ++i) {
    const ElfW(Phdr) &segment = library->dlpi_phdr[i];
    if (segment.p_type != PT_LOAD || (segment.p_flags & PF_W) != 0) continue;
    const std::uintptr_t begin = library->dlpi_addr + segment.p_vaddr,
                         first = (begin + page - 1) / page * page,
                         last = (begin + segment.p_filesz) / page * page;
    if (first < last) ::madvise(at(first), last - first, MADV_DONTNEED);
  }
  return 0;
}

}  // namespace

void give_back_code(bool (*is_meant)(std::string_view path)) {
  ::dl_iterate_phdr(give_back_pages, &is_meant);
}

bool has_opencl() {
  return true;
}

}  // namespace isowave::core::platform
