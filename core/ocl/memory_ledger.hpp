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

  /// Throws  Error: more would be booked than the limit allows
  void add(const std::string &name, std::uint64_t bytes);
  void remove(const std::string &name, std::uint64_t bytes) noexcept;

  /// From now on, no more is booked than so many bytes: for tests, as if the device had no more.
  void set_limit(std::uint64_t bytes) { limit_ = bytes; }

  std::uint64_t current() const { return total_.current; }  ///< bytes
  std::uint64_t peak() const { return total_.peak; }  ///< bytes: the largest current() ever was
  const std::map<std::string, Entry> &by_name() const { return by_name_; }

 private:
  Entry total_;
  std::uint64_t limit_ = UINT64_MAX;
  std::map<std::string, Entry> by_name_;
};

}  // namespace isowave::core::ocl
