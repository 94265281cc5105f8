#include "core/ocl/memory_ledger.hpp"

#include <algorithm>

#include "core/base/error.hpp"

namespace isowave::core::ocl {

void MemoryLedger::add(const std::string &name, std::uint64_t bytes) {
  if (bytes > limit_ - std::min(total_.current, limit_)) {
    throw Error("cannot allocate {} bytes for buffer '{}': {} of {} are in use", bytes, name,
                total_.current, limit_);
  }
  Entry &entry = by_name_[name];  // first, since only these two can throw
  const auto book = [bytes](Entry &target) {
    target.current += bytes;
    target.peak = std::max(target.peak, target.current);
  };
  book(entry);
  book(total_);
}

void MemoryLedger::remove(const std::string &name, std::uint64_t bytes) noexcept {
  const auto found = by_name_.find(name);
  if (found == by_name_.end()) return;
  // Never below zero: a wrong call must not turn the sum into 2^64 bytes.
  bytes = std::min(bytes, found->second.current);
  found->second.current -= bytes;
  total_.current -= bytes;
}

}  // namespace isowave::core::ocl
