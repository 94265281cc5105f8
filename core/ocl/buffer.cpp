#include "core/ocl/buffer.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "core/base/error.hpp"
#include "core/ocl/in_process.hpp"
#include "core/platform/memory.hpp"

namespace isowave::core::ocl {

namespace {

double mebibytes(std::uint64_t bytes) {
  return static_cast<double>(bytes) / (1 << 20);
}

/// The Error to throw for a failed OpenCL call of a buffer.
Error failure(const std::string &name, const char *action, const cl::Error &error) {
  return Error("cannot {} buffer '{}': {}: {}", action, name, error.what(),
               error_name(error.err()));
}

std::vector<cl::Event> events_of(const cl::Event &event) {
  return event() == nullptr ? std::vector<cl::Event>() : std::vector{event};
}

template <std::size_t kBytes>
void enqueue_pattern(cl::CommandQueue &queue, const cl::Buffer &mem, const void *pattern,
                     std::size_t bytes, std::size_t offset, cl::Event *event) {
  std::array<std::byte, kBytes> value;
  std::memcpy(value.data(), pattern, kBytes);
  queue.enqueueFillBuffer(mem, value, offset, bytes, nullptr, event);
}

/// Oclgrind 21.10 takes filled memory for uninitialized and would report every read of it. Memory
/// that the host writes counts as initialized.
void write_pattern(cl::CommandQueue &queue, const cl::Buffer &mem, const void *pattern,
                   std::size_t pattern_bytes, std::size_t bytes, std::size_t offset,
                   cl::Event *event) {
  std::vector<std::byte> values(bytes);
  for (std::size_t i = 0; i < bytes; i += pattern_bytes)
    std::memcpy(&values[i], pattern, pattern_bytes);
  queue.enqueueWriteBuffer(mem, CL_TRUE, offset, bytes, values.data(), nullptr, event);
}

/// Fills mem's bytes [offset, offset + bytes) with copies of the pattern; both are multiples of its
/// size.
void enqueue_fill(Device &device, const cl::Buffer &mem, const void *pattern,
                  std::size_t pattern_bytes, std::size_t bytes, std::size_t offset,
                  cl::Event *event) {
  cl::CommandQueue &queue = device.queue();
  if (device.info().platform == "Oclgrind") {
    return write_pattern(queue, mem, pattern, pattern_bytes, bytes, offset, event);
  }
  switch (pattern_bytes) {  // the C++ bindings take the pattern's size from a type
    case 1:
      return enqueue_pattern<1>(queue, mem, pattern, bytes, offset, event);
    case 2:
      return enqueue_pattern<2>(queue, mem, pattern, bytes, offset, event);
    case 4:
      return enqueue_pattern<4>(queue, mem, pattern, bytes, offset, event);
    case 8:
      return enqueue_pattern<8>(queue, mem, pattern, bytes, offset, event);
    case 16:
      return enqueue_pattern<16>(queue, mem, pattern, bytes, offset, event);
    case 32:
      return enqueue_pattern<32>(queue, mem, pattern, bytes, offset, event);
    case 64:
      return enqueue_pattern<64>(queue, mem, pattern, bytes, offset, event);
    case 128:
      return enqueue_pattern<128>(queue, mem, pattern, bytes, offset, event);
    default:
      throw std::invalid_argument(
          fmt::format("a fill pattern has 1, 2, 4 .. 128 bytes, not {}", pattern_bytes));
  }
}

/// Smaller ones take their bytes of a heap.
constexpr std::size_t kLeastBytesInPages = 1u << 16;

struct Pages {
  std::size_t bytes;
  void operator()(void *begin) const { platform::free_pages(begin, bytes); }
};

/// In pages of this process, all zero, which the system provides when they are written to.
cl::Buffer make_in_pages(const cl::Context &context, std::size_t bytes) {
  std::error_code refusal;
  void *begin = platform::take_pages(bytes, platform::PageUse::kMost, refusal);
  if (begin == nullptr) throw cl::Error(CL_MEM_OBJECT_ALLOCATION_FAILURE, "mmap");
  using Owner = std::unique_ptr<void, Pages>;
  auto pages = std::make_unique<Owner>(begin, Pages{bytes});
  cl::Buffer mem(context, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, begin);
  // Commands that are under way keep the buffer, and with it the pages.
  mem.setDestructorCallback([](cl_mem, void *owner) { delete static_cast<Owner *>(owner); },
                            pages.get());
  static_cast<void>(pages.release());  // the buffer's now
  return mem;
}

/// In the device's memory, all zero and really there. Waits.
cl::Buffer make_filled(Device &device, std::size_t bytes) {
  cl::Buffer mem(device.context(), CL_MEM_READ_WRITE, bytes);
  // Not through the timer: allocating belongs to no stage. Wide patterns are faster where they
  // fit.
  constexpr std::array<std::byte, 4> kZero{};
  const std::size_t pattern_bytes = bytes % kZero.size() == 0 ? kZero.size() : 1;
  enqueue_fill(device, mem, kZero.data(), pattern_bytes, bytes, 0, nullptr);
  device.queue().finish();
  return mem;
}

}  // namespace

RawBuffer::RawBuffer(Device &device, std::string name, std::size_t bytes)
    : device_(&device), name_(std::move(name)) {
  const std::size_t allocated = std::max<std::size_t>(bytes, 1);  // OpenCL has no empty buffers
  const std::uint64_t largest = device.capabilities().largest_allocation;
  if (allocated > largest) {
    throw Error("buffer '{}' wants {:.1f} MiB, device '{}' gives at most {:.1f} MiB to one buffer",
                name_, mebibytes(allocated), device.info().name, mebibytes(largest));
  }
  try {
    const bool in_pages = allocated >= kLeastBytesInPages && is_in_process(device.info());
    cl::Buffer mem =
        in_pages ? make_in_pages(device.context(), allocated) : make_filled(device, allocated);
    device.ledger().add(name_, allocated);
    mem_ = std::move(mem);
    bytes_ = bytes;
  } catch (const cl::Error &error) {
    throw Error(
        "device '{}' cannot allocate {:.1f} MiB for buffer '{}' beside the {:.1f} MiB in use: {}: "
        "{}",
        device.info().name, mebibytes(allocated), name_, mebibytes(device.ledger().current()),
        error.what(), error_name(error.err()));
  }
}

RawBuffer::~RawBuffer() {
  release();
}

RawBuffer::RawBuffer(RawBuffer &&other) noexcept
    : device_(other.device_),
      name_(other.name_),  // NOLINT(performance-move-constructor-init): the empty one still says
                           // who it was
      bytes_(std::exchange(other.bytes_, 0)),
      mem_(std::move(other.mem_)) {}

RawBuffer &RawBuffer::operator=(RawBuffer &&other) noexcept {
  if (this == &other) return *this;
  release();
  device_ = other.device_;
  name_.swap(other.name_);
  bytes_ = std::exchange(other.bytes_, 0);
  mem_ = std::move(other.mem_);
  return *this;
}

void RawBuffer::release() noexcept {
  if (mem_() == nullptr) return;
  device_->ledger().remove(name_, std::max<std::size_t>(bytes_, 1));
  // Dies here instead of being overwritten: the bindings' assignment can throw, their destructor
  // cannot.
  const cl::Buffer dying(std::move(mem_));
  bytes_ = 0;
}

void RawBuffer::write_bytes(const void *src, std::size_t bytes, std::size_t offset, bool blocking) {
  if (bytes == 0) return;  // an error in OpenCL 1.2
  try {
    device_->queue().enqueueWriteBuffer(mem_, blocking, offset, bytes, src, nullptr,
                                        device_->timer().next_event());
  } catch (const cl::Error &error) {
    throw failure(name_, "write", error);
  }
}

void RawBuffer::read_bytes(void *dst, std::size_t bytes, std::size_t offset, bool blocking,
                           cl::Event *event) const {
  try {
    cl::CommandQueue &queue = device_->queue();
    if (bytes == 0) {
      if (event) queue.enqueueMarkerWithWaitList(nullptr, event);
    } else {
      cl::Event *timed = device_->timer().next_event();
      queue.enqueueReadBuffer(mem_, blocking, offset, bytes, dst, nullptr, event ? event : timed);
      if (event && timed) *timed = *event;
    }
    // A host may poll the event, and OpenCL promises no progress before a flush.
    if (!blocking) queue.flush();
  } catch (const cl::Error &error) {
    throw failure(name_, "read", error);
  }
}

void RawBuffer::upload_bytes(const void *src, std::size_t bytes, const cl::Event &after,
                             cl::Event &done) {
  try {
    const std::vector<cl::Event> waits = events_of(after);
    device_->transfer_queue().enqueueWriteBuffer(mem_, CL_FALSE, 0, bytes, src, &waits, &done);
    if (cl::Event *timed = device_->timer().next_event()) *timed = done;
    device_->transfer_queue().flush();
  } catch (const cl::Error &error) {
    throw failure(name_, "upload", error);
  }
}

void RawBuffer::download_bytes(void *dst, std::size_t bytes, std::size_t offset,
                               const cl::Event &after, cl::Event &done) const {
  try {
    const std::vector<cl::Event> waits = events_of(after);
    device_->transfer_queue().enqueueReadBuffer(mem_, CL_FALSE, offset, bytes, dst, &waits, &done);
    if (cl::Event *timed = device_->timer().next_event()) *timed = done;
    device_->transfer_queue().flush();
  } catch (const cl::Error &error) {
    throw failure(name_, "download", error);
  }
}

void RawBuffer::fill_bytes(const void *pattern, std::size_t pattern_bytes, std::size_t bytes,
                           std::size_t offset) {
  if (bytes == 0) return;
  try {
    enqueue_fill(*device_, mem_, pattern, pattern_bytes, bytes, offset,
                 device_->timer().next_event());
  } catch (const cl::Error &error) {
    throw failure(name_, "fill", error);
  }
}

void RawBuffer::copy_bytes(const RawBuffer &from, std::size_t bytes) {
  if (bytes == 0) return;
  try {
    device_->queue().enqueueCopyBuffer(from.mem_, mem_, 0, 0, bytes, nullptr,
                                       device_->timer().next_event());
  } catch (const cl::Error &error) {
    throw failure(name_, "copy to", error);
  }
}

std::size_t RawBuffer::checked_bytes(const BufferSize &size, std::size_t element_bytes) {
  if (size.element_bytes == element_bytes) return bytes_of(size.count, element_bytes);
  throw std::invalid_argument(fmt::format("buffer '{}' has elements of {} bytes, not {}", size.name,
                                          element_bytes, size.element_bytes));
}

void RawBuffer::check_range(std::size_t count, std::size_t offset, std::size_t size) const {
  if (offset <= size && count <= size - offset) return;
  throw std::invalid_argument(fmt::format("{} elements from {} on do not fit buffer '{}' of {}",
                                          count, offset, name_, size));
}

}  // namespace isowave::core::ocl
