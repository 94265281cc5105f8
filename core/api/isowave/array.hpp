#pragma once
// The type of a frame's arrays.

#include <algorithm>
#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace isowave {

/// Values in host memory. A frame's arrays are the memory that its device has copied into: nothing
/// is copied again. They outlive the renderer.
template <class T>
class Array {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Array() = default;
  /// memory: `size` values, which nothing else changes.
  Array(std::shared_ptr<T> memory, std::size_t size)
      : memory_(std::move(memory)), size_(memory_ ? size : 0) {}
  /// Values of any bits.
  explicit Array(std::size_t size)
      : Array(std::shared_ptr<T>(new T[size], std::default_delete<T[]>()), size) {}
  /// A copy.
  explicit Array(std::span<const T> values) : Array(values.size()) {
    std::copy(values.begin(), values.end(), data());
  }
  /// Another array with the same values.
  Array(const Array &other) : Array(std::span<const T>(other.data(), other.size())) {}
  Array(Array &&other) noexcept
      : memory_(std::move(other.memory_)), size_(std::exchange(other.size_, 0)) {}
  Array &operator=(Array other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~Array() = default;

  T *data() { return memory_.get(); }
  const T *data() const { return memory_.get(); }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T *begin() { return data(); }
  T *end() { return data() + size_; }
  const T *begin() const { return data(); }
  const T *end() const { return data() + size_; }
  T &operator[](std::size_t i) { return data()[i]; }
  const T &operator[](std::size_t i) const { return data()[i]; }
  /// A copy.
  std::vector<T> to_vector() const { return {begin(), end()}; }
  operator std::vector<T>() const { return to_vector(); }  // NOLINT(google-explicit-constructor)

  friend bool operator==(const Array &a, std::span<const T> b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  std::shared_ptr<T> memory_;
  std::size_t size_ = 0;
};

}  // namespace isowave
