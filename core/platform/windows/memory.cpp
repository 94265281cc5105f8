#include "core/platform/memory.hpp"

#include <io.h>
#include <malloc.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <mutex>
#include <shared_mutex>  // std::shared_lock

#include "core/platform/windows/system.hpp"

namespace isowave::core::platform {

namespace {

constexpr std::uintptr_t kPageBytes = 1u << 16;  ///< Windows reserves addresses by as many

/// A std::shared_mutex by Windows. That of winpthreads takes memory when it is first locked, which
/// a handler of exceptions should not.
class SharedMutex {
 public:
  void lock() { ::AcquireSRWLockExclusive(&lock_); }
  void unlock() { ::ReleaseSRWLockExclusive(&lock_); }
  void lock_shared() { ::AcquireSRWLockShared(&lock_); }
  void unlock_shared() { ::ReleaseSRWLockShared(&lock_); }

 private:
  SRWLOCK lock_ = SRWLOCK_INIT;
};

/// Where pages have been taken: begin and end.
struct Taken {
  SharedMutex mutex;
  std::map<std::uintptr_t, std::uintptr_t> ranges;
};

Taken &taken() {
  static Taken all;
  return all;
}

void *pointer_to(std::uintptr_t address) {
  return reinterpret_cast<void *>(address);
}

/// Gives a taken page memory when it is touched first. Windows itself would promise memory for all
/// reserved pages at once.
LONG CALLBACK provide_page(EXCEPTION_POINTERS *exception) {
  const EXCEPTION_RECORD &record = *exception->ExceptionRecord;
  if (record.ExceptionCode != EXCEPTION_ACCESS_VIOLATION || record.NumberParameters < 2)
    return EXCEPTION_CONTINUE_SEARCH;
  const std::uintptr_t address = record.ExceptionInformation[1];
  const std::shared_lock lock(taken().mutex);
  const auto next = taken().ranges.upper_bound(address);
  if (next == taken().ranges.begin() || address >= std::prev(next)->second)
    return EXCEPTION_CONTINUE_SEARCH;
  const std::uintptr_t page = address / kPageBytes * kPageBytes,
                       end = std::min(page + kPageBytes, std::prev(next)->second);
  return ::VirtualAlloc(pointer_to(page), end - page, MEM_COMMIT, PAGE_READWRITE) != nullptr
             ? EXCEPTION_CONTINUE_EXECUTION
             : EXCEPTION_CONTINUE_SEARCH;
}

}  // namespace

std::uint64_t page_bytes() {
  return kPageBytes;
}

std::uint64_t host_memory() {
  MEMORYSTATUSEX status{};
  status.dwLength = sizeof(status);
  return ::GlobalMemoryStatusEx(&status) != 0 ? status.ullTotalPhys : 0;
}

bool has_address_space(std::size_t bytes) {
  void *const room = ::VirtualAlloc(nullptr, bytes, MEM_RESERVE, PAGE_NOACCESS);
  return room != nullptr && ::VirtualFree(room, 0, MEM_RELEASE) != 0;
}

void *take_pages(std::size_t bytes, PageUse use, std::error_code &failure) {
  static void *const handler = ::AddVectoredExceptionHandler(1, provide_page);
  const bool at_once = use == PageUse::kMost || handler == nullptr;
  void *const pages = ::VirtualAlloc(
      nullptr, bytes, at_once ? MEM_RESERVE | MEM_COMMIT : MEM_RESERVE, PAGE_READWRITE);
  failure = pages == nullptr ? last_system_failure() : std::error_code();
  if (failure) return nullptr;
  const auto begin = reinterpret_cast<std::uintptr_t>(pages);
  const std::scoped_lock lock(taken().mutex);
  taken().ranges.emplace(begin, begin + bytes);
  return pages;
}

void clear_pages(void *pages, std::size_t bytes, std::error_code &failure) {
  failure =
      ::VirtualFree(pages, bytes, MEM_DECOMMIT) != 0 ? std::error_code() : last_system_failure();
}

void free_pages(void *pages, std::size_t) noexcept {
  {
    const std::scoped_lock lock(taken().mutex);
    taken().ranges.erase(reinterpret_cast<std::uintptr_t>(pages));
  }
  ::VirtualFree(pages, 0, MEM_RELEASE);
}

const void *map_file(std::FILE *file, std::size_t bytes, std::error_code &failure) {
  const auto handle = reinterpret_cast<HANDLE>(::_get_osfhandle(::_fileno(file)));
  // The view keeps the mapping.
  const Handle mapping(::CreateFileMappingW(handle, nullptr, PAGE_READONLY, 0, 0, nullptr));
  const void *const view =
      mapping.is_open() ? ::MapViewOfFile(mapping.get(), FILE_MAP_READ, 0, 0, bytes) : nullptr;
  failure = view == nullptr ? last_system_failure() : std::error_code();
  return view;
}

void unmap_file(const void *mapped, std::size_t) noexcept {
  ::UnmapViewOfFile(mapped);
}

void give_back_heap() {
  ::_heapmin();
}

}  // namespace isowave::core::platform
