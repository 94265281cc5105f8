// A library for LD_PRELOAD: the program gets no memory from a certain request on.
//
//   LD_PRELOAD=libfailing_memory.so FAILING_MEMORY_AT=n PROGRAM
//
// FAILING_MEMORY_AT    number of the first request that fails, from 1 on; none fails without it
// FAILING_MEMORY_ONCE  if set, the requests behind that one succeed again
// FAILING_MEMORY_COUNT file to which the number of requests is written when the process ends
//
// Requests count if they come from the program itself, or from a library that is to survive without
// memory: TBB, zfp, libpng, zlib, fmt. They may come through the C and the C++ library. PoCL and
// LLVM abort without memory, whatever the program does. So no request counts that has any other
// library on its stack: LLVM also calls templates of std::string that the program has instantiated.
// Requests within dlopen(), by which TBB looks for libraries that may be missing, do not count
// either: glibc (2.36) reads a null pointer without memory for their error.

#include <dlfcn.h>
#include <link.h>
#include <malloc.h>
#include <sys/mman.h>
#include <unwind.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <utility>

extern "C" {
void *__libc_malloc(std::size_t);
void *__libc_calloc(std::size_t, std::size_t);
void *__libc_realloc(void *, std::size_t);
void *__libc_memalign(std::size_t, std::size_t);
}

namespace {

enum class Caller { kCounts, kPassesOn, kOther };

/// The module that the address is in, by its name.
Caller caller_at(void *address) {
  dl_find_object found{};
  if (_dl_find_object(address, &found) != 0) return Caller::kOther;
  const std::string_view path = found.dlfo_link_map->l_name;
  if (path.empty()) return Caller::kCounts;  // the program
  const std::string_view name = path.substr(path.rfind('/') + 1);
  for (const char *library : {"libtbb", "libzfp", "libpng", "libz.", "libfmt"}) {
    if (name.starts_with(library)) return Caller::kCounts;
  }
  for (const char *library : {"libc.", "libstdc++", "libgcc_s", "ld-linux", "libfailing_memory"}) {
    if (name.starts_with(library)) return Caller::kPassesOn;
  }
  return Caller::kOther;
}

_Unwind_Reason_Code look_at_frame(_Unwind_Context *frame, void *result) {
  if (_Unwind_GetIP(frame) == 0) return _URC_END_OF_STACK;
  auto &caller = *static_cast<Caller *>(result);
  const Caller here = caller_at(reinterpret_cast<void *>(_Unwind_GetIP(frame) - 1));
  if (here != Caller::kPassesOn) caller = here;
  return here == Caller::kOther ? _URC_END_OF_STACK : _URC_NO_REASON;
}

std::atomic<long> num_requests{0};
long fails_at = 0;
bool fails_once = false;
bool counts = false;                                                   ///< the process has begun
[[gnu::tls_model("initial-exec")]] thread_local bool in_here = false;  ///< not to be counted

/// immediate  the address that the request returns to
bool fails(void *immediate) {
  if (!counts || in_here) return false;
  in_here = true;
  Caller caller = caller_at(immediate);
  if (caller != Caller::kOther) _Unwind_Backtrace(look_at_frame, &caller);
  in_here = false;
  if (caller != Caller::kCounts) return false;
  const long request = ++num_requests;
  const bool failed = fails_at > 0 && (fails_once ? request == fails_at : request >= fails_at);
  if (failed) errno = ENOMEM;
  return failed;
}

/// Before the constructors of the program's own objects.
[[gnu::constructor(101)]] void begin() {
  if (const char *at = std::getenv("FAILING_MEMORY_AT")) fails_at = std::atol(at);
  fails_once = std::getenv("FAILING_MEMORY_ONCE") != nullptr;
  counts = true;
}

[[gnu::destructor]] void end() {
  counts = false;
  const char *path = std::getenv("FAILING_MEMORY_COUNT");
  std::FILE *file = path == nullptr ? nullptr : std::fopen(path, "w");
  if (file == nullptr) return;
  std::fprintf(file, "%ld\n", num_requests.load());
  std::fclose(file);
}

}  // namespace

extern "C" {

void *malloc(std::size_t size) {
  return fails(__builtin_return_address(0)) ? nullptr : __libc_malloc(size);
}
void *calloc(std::size_t count, std::size_t size) {
  return fails(__builtin_return_address(0)) ? nullptr : __libc_calloc(count, size);
}
void *realloc(void *old, std::size_t size) {
  return fails(__builtin_return_address(0)) ? nullptr : __libc_realloc(old, size);
}
void *memalign(std::size_t alignment, std::size_t size) {
  return fails(__builtin_return_address(0)) ? nullptr : __libc_memalign(alignment, size);
}
void *aligned_alloc(std::size_t alignment, std::size_t size) {
  return fails(__builtin_return_address(0)) ? nullptr : __libc_memalign(alignment, size);
}
int posix_memalign(void **result, std::size_t alignment, std::size_t size) {
  if (fails(__builtin_return_address(0))) return ENOMEM;
  *result = __libc_memalign(alignment, size);
  return *result == nullptr ? ENOMEM : 0;
}
void *mmap(void *address, std::size_t size, int protection, int flags, int file, off_t offset) {
  static const auto real = reinterpret_cast<decltype(&mmap)>(dlsym(RTLD_NEXT, "mmap"));
  return fails(__builtin_return_address(0)) ? MAP_FAILED
                                            : real(address, size, protection, flags, file, offset);
}

void *dlopen(const char *file, int mode) {
  static const auto real = reinterpret_cast<decltype(&dlopen)>(dlsym(RTLD_NEXT, "dlopen"));
  const bool was_in_here = std::exchange(in_here, true);
  void *const handle = real(file, mode);
  in_here = was_in_here;
  return handle;
}

}  // extern "C"
