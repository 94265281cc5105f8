#pragma once
// The passes that are on the device. Their counts are on their way to the host.

#include <cstddef>
#include <utility>

#include "core/render/pass_readback.hpp"
#include "core/render/wave.hpp"
#include "core/stages/wavefront.hpp"

namespace isowave::core {

/// The queue of passes. At most two are in flight: the host reads one pass behind, and the device
/// never waits for the host. A pass in flight may belong to another wave than the one at work: one
/// pass beyond the last of the wave before, which found no rays, or the first pass of the next
/// wave, which has begun early.
class Passes {
 public:
  Passes(ocl::Device &device, Wavefront &rays) : rays_(rays), readback_(device) {}

  /// Enqueues the first pass of a wave, unless it has begun early.
  void begin(Wave &wave) {
    if (std::exchange(early_, nullptr) == &wave) return;
    num_beyond_ = readback_.in_flight();
    wave.begin();
    enqueue(wave);
  }
  /// Enqueues the first pass of the next wave behind the only one in flight.
  void begin_early(Wave &next) {
    next.begin();
    enqueue(next);
    early_ = &next;
  }
  /// Takes begin_early() back. The early pass has done nothing, since it found rays of the wave at
  /// work.
  void take_back_early() {
    if (std::exchange(early_, nullptr) == nullptr) return;
    readback_.drain();
    rays_.unopen_pass();
  }
  void enqueue(Wave &wave) {
    wave.enqueue_pass();
    readback_.push(rays_.counts);
  }

  bool has_early() const { return early_ != nullptr; }
  /// Whether no pass of the wave at work is in flight.
  bool are_read() const { return readback_.in_flight() == num_beyond_; }
  /// Whether another pass may be enqueued. Waits for a pass beyond the wave before if that makes
  /// room.
  bool have_room() {
    if (readback_.in_flight() == PassReadback::kMaxInFlight) pop_beyond();
    return readback_.in_flight() < PassReadback::kMaxInFlight;
  }

  /// Waits for the oldest pass of the wave at work.
  PassCounts pop() {
    while (num_beyond_ != 0) pop_beyond();
    return readback_.pop();
  }
  /// Waits for all passes, and forgets them.
  void drain() {
    readback_.drain();
    num_beyond_ = 0;
    early_ = nullptr;
  }

 private:
  void pop_beyond() {
    if (num_beyond_ == 0) return;
    readback_.pop();
    --num_beyond_;
  }

  Wavefront &rays_;
  PassReadback readback_;
  std::size_t num_beyond_ = 0;  ///< passes in flight beyond the last of the wave before
  Wave *early_ = nullptr;       ///< the wave that has begun early
};

}  // namespace isowave::core
