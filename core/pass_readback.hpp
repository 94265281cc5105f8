#pragma once
// Brings the counts of each pass to the host without blocking the chain of launches.

#include <array>
#include <cstddef>

#include "core/device_counts.hpp"

namespace isowave {

/// A queue of at most two read-backs in flight. Its memory must outlive them: drain before destruction.
class PassReadback {
 public:
  ~PassReadback() {
    try {
      while (in_flight_ != 0) pop();
    } catch (...) {  // a device error is reported by whoever waits next
    }
  }

  std::size_t in_flight() const { return in_flight_; }

  /// Enqueues a read of the counts as they are when the device gets here. At most two may be in flight.
  void push(const CountsBuffer &counts) {
    Slot &slot = slots_[next_++ % slots_.size()];
    counts.read_async({&slot.counts, 1}, slot.event);
    ++in_flight_;
  }

  /// Waits for the oldest read.
  PassCounts pop() {
    const Slot &slot = slots_[(next_ - in_flight_) % slots_.size()];
    --in_flight_;
    slot.event.wait();
    return slot.counts;
  }

 private:
  struct Slot {
    PassCounts counts{};
    cl::Event event;
  };
  std::array<Slot, 2> slots_;
  std::size_t next_ = 0, in_flight_ = 0;
};

}  // namespace isowave
