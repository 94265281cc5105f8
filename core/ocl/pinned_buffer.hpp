#pragma once
// Host memory that a device can copy from without help of the processor, so that transfers overlap
// with work.

#include <CL/opencl.hpp>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "core/ocl/buffer_sizes.hpp"
#include "core/ocl/device.hpp"

namespace isowave::core::ocl {

/// 32-bit words. Booked in the device's ledger all the same: a driver may keep a copy on the
/// device, and some devices share the host's memory.
class PinnedBuffer {
 public:
  /// size: of 32-bit words, not 0 of them.
  ///
  /// Throws  Error: there is no such memory; std::invalid_argument: elements of another size
  PinnedBuffer(Device &device, const BufferSize &size);
  /// Waits for all commands. If the device fails to say that they are done, the words are never
  /// freed, since a transfer may still be under way.
  ~PinnedBuffer();
  PinnedBuffer(const PinnedBuffer &) = delete;
  PinnedBuffer &operator=(const PinnedBuffer &) = delete;

  std::span<std::uint32_t> words() const { return words_; }

 private:
  Device &device_;
  std::string name_;
  cl::Buffer mem_;
  std::span<std::uint32_t> words_;
};

}  // namespace isowave::core::ocl
