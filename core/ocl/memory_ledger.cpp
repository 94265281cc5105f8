#include "core/ocl/memory_ledger.hpp"

#include <algorithm>

namespace isowave::core::ocl {

void MemoryLedger::add(const std::string &name, std::uint64_t bytes) {
  Entry &entry = by_name_[name];  // first, since only this can throw
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
