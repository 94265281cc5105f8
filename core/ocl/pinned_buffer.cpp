#include "core/ocl/pinned_buffer.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/base/error.hpp"

namespace isowave::core::ocl {

PinnedBuffer::PinnedBuffer(Device &device, const BufferSize &size)
    : device_(device), name_(size.name) {
  if (size.element_bytes != sizeof(std::uint32_t))
    throw std::invalid_argument(fmt::format("buffer '{}' is not of 32-bit words", name_));
  const std::size_t bytes = size.bytes();
  try {
    mem_ = cl::Buffer(device.context(), CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR, bytes);
    void *mapped =
        device.queue().enqueueMapBuffer(mem_, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0, bytes);
    words_ = {static_cast<std::uint32_t *>(mapped), size.count};
    device.ledger().add(name_, bytes);
  } catch (const cl::Error &error) {
    throw Error("device '{}' cannot allocate {} bytes for '{}': {}: {}", device.info().name, bytes,
                name_, error.what(), error_name(error.err()));
  }
  std::ranges::fill(words_, 0u);  // drivers allocate lazily
}

PinnedBuffer::~PinnedBuffer() {
  device_.ledger().remove(name_, words_.size_bytes());
  if (!device_.settle()) {
    mem_() = nullptr;  // not released
    return;
  }
  try {
    device_.queue().enqueueUnmapMemObject(mem_, words_.data());
    device_.queue().finish();
  } catch (...) {  // the device has failed since; no command uses the words
  }
}

}  // namespace isowave::core::ocl
