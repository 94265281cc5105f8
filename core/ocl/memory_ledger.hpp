#pragma once
// Counts every device buffer of a Device: current and peak bytes, in all and by name.

#include <cstdint>
#include <map>
#include <string>

namespace isowave::core::ocl {

class MemoryLedger {
 public:
  struct Entry {
    std::uint64_t current = 0, peak = 0;  ///< bytes
  };

  void add(const std::string &name, std::uint64_t bytes);
  void remove(const std::string &name, std::uint64_t bytes) noexcept;

  std::uint64_t current() const { return total_.current; }  ///< bytes
  std::uint64_t peak() const { return total_.peak; }  ///< bytes: the largest current() ever was
  const std::map<std::string, Entry> &by_name() const { return by_name_; }

 private:
  Entry total_;
  std::map<std::string, Entry> by_name_;
};

}  // namespace isowave::core::ocl
