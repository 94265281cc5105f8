#pragma once
// Device buffers that are still to be made. Who makes buffers states them once, in a function
// sizes(): its constructor makes them from that list, and the memory plan adds the same list up.

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace isowave::core::ocl {

/// One buffer: Buffer<T> and PinnedBuffer are made from it.
struct BufferSize {
  std::string name;                 ///< as in the device's MemoryLedger
  std::uint64_t element_bytes = 1;  ///< not 0
  std::uint64_t count = 0;          ///< elements

  /// The bytes that the ledger books: at least 1, since OpenCL has no empty buffers; 2^64 - 1,
  /// which no device has, instead of an overflow.
  std::uint64_t bytes() const;
};

/// `count` elements of T.
template <class T>
BufferSize buffer_size(std::string name, std::uint64_t count) {
  return {std::move(name), sizeof(T), count};
}

/// Buffers in the order in which they are made. Several may have the same name.
class BufferSizes {
 public:
  BufferSizes() = default;
  BufferSizes(std::initializer_list<BufferSize> sizes) : sizes_(sizes) {}

  /// Appends others. Returns *this.
  BufferSizes &add(const BufferSizes &others);
  /// All buffers whose name one of the others has become as long as the first such.
  void resize(const BufferSizes &others);

  /// The first buffer of that name.
  ///
  /// Throws  std::invalid_argument: there is none, since the constructor at work asks for a buffer
  ///         that its sizes() does not state
  const BufferSize &operator[](std::string_view name) const;
  /// All of that name.
  BufferSizes named(std::string_view name) const;

  std::uint64_t bytes() const;  ///< of all together
  std::size_t size() const { return sizes_.size(); }
  auto begin() const { return sizes_.begin(); }
  auto end() const { return sizes_.end(); }

 private:
  std::vector<BufferSize> sizes_;
};

}  // namespace isowave::core::ocl
