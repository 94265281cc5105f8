#pragma once
// Arrays in host memory that a renderer fills and hands to its caller without a copy.

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace isowave::core {

/// Values that one owner has. The memory may be a HostMemory's, and outlives it.
template <class T>
class HostArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  HostArray() = default;
  /// memory: for `size` values, of any bits.
  HostArray(std::shared_ptr<std::byte> memory, std::size_t size)
      : memory_(std::move(memory)), size_(size) {}
  HostArray(HostArray &&other) noexcept
      : memory_(std::move(other.memory_)), size_(std::exchange(other.size_, 0)) {}
  HostArray &operator=(HostArray &&other) noexcept {
    memory_ = std::move(other.memory_);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }

  T *data() { return reinterpret_cast<T *>(memory_.get()); }
  const T *data() const { return reinterpret_cast<const T *>(memory_.get()); }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return size_ * sizeof(T); }
  bool empty() const { return size_ == 0; }
  T *begin() { return data(); }
  T *end() { return data() + size_; }
  const T *begin() const { return data(); }
  const T *end() const { return data() + size_; }
  T &operator[](std::size_t i) { return data()[i]; }
  const T &operator[](std::size_t i) const { return data()[i]; }
  std::vector<T> copy() const { return {begin(), end()}; }

  /// Gives up the memory.
  std::shared_ptr<std::byte> release() {
    size_ = 0;
    return std::move(memory_);
  }

 private:
  std::shared_ptr<std::byte> memory_;
  std::size_t size_ = 0;
};

/// The memory of arrays. If an array goes, its memory serves the next one: a picture's fresh pages
/// take longer than its copy from a GPU. Arrays may go in any thread, and after the HostMemory.
class HostMemory {
 public:
  /// Makes a device copy into the memory without help of the processor. The end of the result
  /// undoes that, while the memory is still there.
  using Pin = std::function<std::shared_ptr<void>(std::span<std::byte>)>;
  explicit HostMemory(Pin pin = {}) : pin_(std::move(pin)) {}

  /// Values of any bits.
  template <class T>
  HostArray<T> array(std::size_t size) {
    return {take(size * sizeof(T)), size};
  }

  /// Pieces of memory that are kept at most. Further ones are their arrays' alone.
  static constexpr std::size_t kMostPieces = 8;

 private:
  struct Piece {
    std::shared_ptr<std::byte> memory;
    std::size_t bytes;
    std::shared_ptr<void> pinned;  ///< goes before the memory
  };

  std::shared_ptr<std::byte> take(std::size_t bytes);

  Pin pin_;
  std::vector<Piece> pieces_;  ///< the oldest first
};

}  // namespace isowave::core
