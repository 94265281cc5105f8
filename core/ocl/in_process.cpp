#include "core/ocl/in_process.hpp"

#include <link.h>
#include <malloc.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string_view>

namespace isowave::core::ocl {

namespace {

bool is_compiler(std::string_view path) {
  const std::string_view name = path.substr(path.rfind('/') + 1);
  return name.starts_with("libLLVM") || name.starts_with("libclang-cpp");
}

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

/// Whole pages that nobody can have written to. What the loader writes to and then protects lies in
/// segments that are writable by their headers.
int give_back_code(dl_phdr_info *library, std::size_t, void *) {
  if (!is_compiler(library->dlpi_name) || has_changed_code(*library)) return 0;
  const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
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

bool is_in_process(const DeviceInfo &device) {
  return device.platform == "Portable Computing Language" && device.type == DeviceType::kCpu;
}

void give_back_compiler(const DeviceInfo &device) {
  if (!is_in_process(device)) return;
  ::dl_iterate_phdr(give_back_code, nullptr);
  ::malloc_trim(0);
}

}  // namespace isowave::core::ocl
