#pragma once
// Large arrays of which only a part is ever used.

#include <cstdint>

namespace isowave::core {

/// Memory of zeros whose pages the system provides when they are written to first: until then they
/// take address space alone.
class ReservedMemory {
 public:
  /// num_bytes  0 is allowed
  /// Throws     Error: the system has not so much address space left, or does not overcommit
  explicit ReservedMemory(std::uint64_t num_bytes);
  ~ReservedMemory();
  ReservedMemory(const ReservedMemory &) = delete;
  ReservedMemory &operator=(const ReservedMemory &) = delete;

  void *data() const { return data_; }
  /// Gives all pages back. What was written is zeros again.
  void release();

 private:
  std::uint64_t num_bytes_;
  void *data_ = nullptr;
};

}  // namespace isowave::core
