// A library for LD_PRELOAD: PoCL compiles kernels for another x86 CPU than the machine's, one that
// can do less. PoCL asks libLLVM what the machine can do; this answers instead.
//
//   LD_PRELOAD=libpocl_as_cpu.so POCL_AS_CPU=haswell PROGRAM
//
// POCL_AS_CPU is haswell (AVX2, no AVX-512) or athlon64 (SSE2 alone), as PoCL calls such CPUs, and
// its device then. Any other ends the process.
//
// A PoCL that has LLVM within itself, as that of Python's packages, does not ask: its device keeps
// its name.

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>

// As LLVM 3 to 18 have them (llvm/ADT/StringMap.h), under names of their own: LLVM's headers are
// not needed, nor is a certain version.
namespace llvm {

class StringRef {
 public:
  explicit StringRef(std::string_view text) : data(text.data()), length(text.size()) {}
  const char *data;
  std::size_t length;
};

class MallocAllocator;

template <class Value, class Allocator>
struct StringMap {
  /// Its length, its value, and after item_size bytes its text.
  struct Entry {
    std::size_t length;
    Value value;
  };
  Entry **table;
  unsigned num_buckets, num_items, num_tombstones, item_size;
};

namespace sys {
StringRef getHostCPUName();
bool getHostCPUFeatures(StringMap<bool, MallocAllocator> &features);
}  // namespace sys

}  // namespace llvm

namespace {

struct Cpu {
  const char *name;
  const char *features;  ///< those that it has, separated by spaces
};

constexpr std::array kCpus = {
    Cpu{"athlon64", "64bit cmov cx8 fxsr mmx sse sse2"},
    Cpu{"haswell",
        "64bit avx avx2 bmi bmi2 cmov cx16 cx8 crc32 f16c fma fsgsbase fxsr invpcid lzcnt mmx "
        "movbe pclmul popcnt rdrnd sahf sse sse2 sse3 sse4.1 sse4.2 ssse3 xsave xsaveopt"},
};

const Cpu &cpu() {
  const char *name = std::getenv("POCL_AS_CPU");
  for (const Cpu &one : kCpus) {
    if (name != nullptr && std::strcmp(one.name, name) == 0) return one;
  }
  std::fprintf(stderr, "pocl_as_cpu: POCL_AS_CPU is neither haswell nor athlon64\n");
  std::_Exit(1);
}

bool has_word(std::string_view words, std::string_view word) {
  for (std::size_t begin = 0; begin < words.size();) {
    const std::size_t end = std::min(words.find(' ', begin), words.size());
    if (words.substr(begin, end - begin) == word) return true;
    begin = end + 1;
  }
  return false;
}

/// LLVM's own function. OpenCL's loader opens PoCL for itself alone, and LLVM with it: RTLD_NEXT
/// does not see them.
///
/// caller  an address within PoCL
void *llvm_function_of(void *caller, const char *name) {
  Dl_info pocl{};
  if (dladdr(caller, &pocl) == 0) return nullptr;
  void *library = dlopen(pocl.dli_fname, RTLD_LAZY | RTLD_NOLOAD);
  return library == nullptr ? nullptr : dlsym(library, name);
}

}  // namespace

llvm::StringRef llvm::sys::getHostCPUName() {
  return StringRef(cpu().name);
}

/// What the machine can do and this CPU cannot is off.
bool llvm::sys::getHostCPUFeatures(StringMap<bool, MallocAllocator> &features) {
  const auto ask_llvm = reinterpret_cast<decltype(&getHostCPUFeatures)>(
      llvm_function_of(__builtin_return_address(0),
                       "_ZN4llvm3sys18getHostCPUFeaturesERNS_9StringMapIbNS_15MallocAllocatorEEE"));
  if (ask_llvm == nullptr || !ask_llvm(features)) return false;
  for (unsigned bucket = 0; bucket < features.num_buckets; ++bucket) {
    auto *entry = features.table[bucket];
    if (entry == nullptr) continue;
    const char *text = reinterpret_cast<const char *>(entry) + features.item_size;
    entry->value = entry->value && has_word(cpu().features, {text, entry->length});
  }
  return true;
}
