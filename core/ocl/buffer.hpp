#pragma once
// Typed device memory that knows its name and count and is booked in the device's ledger.

#include <CL/opencl.hpp>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/ocl/buffer_sizes.hpp"
#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

/// The untyped part of Buffer: allocation, transfers, checks. Messages name the buffer.
/// A moved-from buffer holds nothing: size 0, no memory, not in the ledger.
class RawBuffer {
 public:
  /// Allocates `bytes` (1 for 0), all zero, and waits, so that a budget counts memory that is
  /// really there. If the device is_in_process(), pages take no memory until they are written to.
  ///
  /// Throws  Error: the device cannot allocate them
  RawBuffer(Device &device, std::string name, std::size_t bytes);
  ~RawBuffer();
  RawBuffer(RawBuffer &&) noexcept;
  RawBuffer &operator=(RawBuffer &&) noexcept;

  const std::string &name() const { return name_; }
  std::size_t bytes() const { return bytes_; }  ///< as asked for; 0 when moved from
  const cl::Buffer &mem() const { return mem_; }
  Device &device() const { return *device_; }

 protected:
  void write_bytes(const void *src, std::size_t bytes, std::size_t offset, bool blocking);
  /// Sets *event, if given, even for 0 bytes.
  void read_bytes(void *dst, std::size_t bytes, std::size_t offset, bool blocking,
                  cl::Event *event) const;
  /// On the transfer queue, which is flushed. A null `after` is no event to wait for.
  void upload_bytes(const void *src, std::size_t bytes, const cl::Event &after, cl::Event &done);
  void download_bytes(void *dst, std::size_t bytes, std::size_t offset, const cl::Event &after,
                      cl::Event &done) const;
  void fill_bytes(const void *pattern, std::size_t pattern_bytes, std::size_t bytes,
                  std::size_t offset);
  void copy_bytes(const RawBuffer &from, std::size_t bytes);
  void check_range(std::size_t count, std::size_t offset, std::size_t size) const;
  /// Its elements' bytes.
  ///
  /// Throws  std::invalid_argument unless elements have element_bytes each
  static std::size_t checked_bytes(const BufferSize &size, std::size_t element_bytes);
  /// count * element_bytes; SIZE_MAX, which no device has, instead of an overflow.
  static std::size_t bytes_of(std::size_t count, std::size_t element_bytes) {
    return count > SIZE_MAX / element_bytes ? SIZE_MAX : count * element_bytes;
  }

 private:
  void release() noexcept;
  Device *device_ = nullptr;
  std::string name_;
  std::size_t bytes_ = 0;
  cl::Buffer mem_;
};

/// `count` elements of T on a device. Move-only.
template <class T>
class Buffer : public RawBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer(Device &device, std::string name, std::size_t count)
      : RawBuffer(device, std::move(name), bytes_of(count, sizeof(T))) {}
  /// Throws  std::invalid_argument: the size is that of elements of another size
  Buffer(Device &device, const BufferSize &size)
      : RawBuffer(device, size.name, checked_bytes(size, sizeof(T))) {}
  /// Holds a copy of `data`.
  ///
  /// Waits  yes
  Buffer(Device &device, std::string name, std::span<const T> data)
      : Buffer(device, std::move(name), data.size()) {
    write(data);
  }

  std::size_t size() const { return bytes() / sizeof(T); }

  /// Host -> elements [offset, offset + data.size()).
  ///
  /// Throws  std::invalid_argument: past the end
  /// Waits   yes
  void write(std::span<const T> data, std::size_t offset = 0) {
    check_range(data.size(), offset, size());
    write_bytes(data.data(), data.size_bytes(), offset * sizeof(T), true);
  }
  /// As write(), but returns at once: `data` must live until the queue has come so far.
  void write_async(std::span<const T> data) {
    check_range(data.size(), 0, size());
    write_bytes(data.data(), data.size_bytes(), 0, false);
  }
  /// Elements [offset, offset + out.size()) -> host.
  ///
  /// Waits  yes
  void read(std::span<T> out, std::size_t offset = 0) const {
    check_range(out.size(), offset, size());
    read_bytes(out.data(), out.size_bytes(), offset * sizeof(T), true, nullptr);
  }
  std::vector<T> read() const {
    std::vector<T> out(size());
    read(out);
    return out;
  }
  /// As read(), but returns at once, with the queue flushed; `out` is valid when `event` completes
  /// and must live until then.
  void read_async(std::span<T> out, cl::Event &event, std::size_t offset = 0) const {
    check_range(out.size(), offset, size());
    read_bytes(out.data(), out.size_bytes(), offset * sizeof(T), false, &event);
  }
  /// Host -> elements [0, data.size()), which is not 0, on the device's transfer queue, when
  /// `after` is complete, if it is an event. Returns at once; `data` must live until `done`
  /// completes.
  void upload(std::span<const T> data, const cl::Event &after, cl::Event &done) {
    check_range(data.size(), 0, size());
    upload_bytes(data.data(), data.size_bytes(), after, done);
  }
  /// Elements [offset, offset + out.size()), which is not 0, -> host, as upload().
  void download(std::span<T> out, std::size_t offset, const cl::Event &after,
                cl::Event &done) const {
    check_range(out.size(), offset, size());
    download_bytes(out.data(), out.size_bytes(), offset * sizeof(T), after, done);
  }
  /// Sets elements [offset, offset + count) to `value`, in queue order. Does not wait.
  void fill(const T &value, std::size_t offset, std::size_t count) {
    static_assert(std::has_single_bit(sizeof(T)) && sizeof(T) <= 128,
                  "OpenCL fills patterns of 1, 2, 4 .. 128 bytes");
    check_range(count, offset, size());
    fill_bytes(&value, sizeof(T), count * sizeof(T), offset * sizeof(T));
  }
  void fill(const T &value) { fill(value, 0, size()); }
  /// Elements [0, count) become those of `from`, in queue order. Does not wait.
  void copy(const Buffer &from, std::size_t count) {
    check_range(count, 0, size());
    from.check_range(count, 0, from.size());
    copy_bytes(from, count * sizeof(T));
  }
};

}  // namespace isowave::core::ocl
