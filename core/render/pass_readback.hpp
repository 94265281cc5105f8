#pragma once
// Brings the counts of each pass to the host without blocking the chain of launches.

#include <array>
#include <cstddef>
#include <cstring>
#include <span>

#include "core/ocl/pinned_buffer.hpp"
#include "core/stages/device_counts.hpp"

namespace isowave::core {

/// A queue of at most two read-backs in flight. Their memory is pinned: to other memory, NVIDIA's
/// driver copies by a detour that costs a cold 512^3 frame a fifth of its time (H100).
class PassReadback {
 public:
  static constexpr std::size_t kMaxInFlight = 2;

  static ocl::BufferSizes sizes() {
    return {ocl::buffer_size<uint>("pass counts, read back", kMaxInFlight * kWords)};
  }
  explicit PassReadback(ocl::Device &device) : memory_(device, sizes()["pass counts, read back"]) {}
  PassReadback(const PassReadback &) = delete;
  PassReadback &operator=(const PassReadback &) = delete;

  std::size_t in_flight() const { return in_flight_; }

  /// Enqueues a read of the counts as they are when the device gets here. At most two may be in
  /// flight.
  void push(const CountsBuffer &counts) {
    const std::size_t slot = next_++ % kMaxInFlight;
    auto *into = reinterpret_cast<PassCounts *>(memory_.words().subspan(slot * kWords).data());
    counts.read_async({into, 1}, done_[slot]);
    ++in_flight_;
  }

  /// Waits for the oldest read.
  PassCounts pop() {
    const std::size_t slot = (next_ - in_flight_) % kMaxInFlight;
    --in_flight_;
    done_[slot].wait();
    PassCounts counts;
    std::memcpy(&counts, memory_.words().subspan(slot * kWords).data(), sizeof(counts));
    return counts;
  }

  /// Waits for all, and forgets them.
  void drain() {
    while (in_flight_ != 0) pop();
  }

 private:
  static constexpr std::size_t kWords = sizeof(PassCounts) / sizeof(uint);

  ocl::PinnedBuffer memory_;
  std::array<cl::Event, kMaxInFlight> done_;
  std::size_t next_ = 0, in_flight_ = 0;
};

}  // namespace isowave::core
