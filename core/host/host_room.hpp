#pragma once
// The memory that decoded blocks share, and the work of threads that decode within it.

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

namespace isowave::core {

/// A bound on memory. Not thread-safe, except the functions that work within run() calls.
class HostRoom {
 public:
  static constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

  /// Thrown if something would pass the limit.
  struct NoRoom {};

  /// num_threads: 0: one per processor
  HostRoom(std::uint64_t limit, std::uint32_t num_threads)
      : limit_(limit), num_threads_(num_threads) {}
  HostRoom(const HostRoom &) = delete;
  HostRoom &operator=(const HostRoom &) = delete;

  /// drop: gives back memory that can be made again, with give_back()
  void add(std::function<void()> drop) { drops_.push_back(std::move(drop)); }
  /// Counts memory that stays. What can be made again is dropped for it.
  void hold(std::uint64_t num_bytes);
  std::uint64_t bytes() const { return num_bytes_.load(std::memory_order_relaxed); }

  /// Calls work(item, is_alone) for each item below num_items on all threads. Its rays decode the
  /// blocks that they need. If decoded blocks would pass the limit, items end with an exception,
  /// all decoded blocks are dropped, and these items begin again. If no item can be finished in
  /// this way, one thread does the next item, with is_alone: its rays must be traced one by one,
  /// not in packets, since there is room only for the blocks of one ray at a time.
  ///
  /// Throws  an exception of work
  void run(std::uint64_t num_items,
           const std::function<void(std::uint64_t item, bool is_alone)> &work);

  // Within work. Thread-safe.

  /// Counts memory.
  ///
  /// Throws  NoRoom: it would pass the limit, and is not counted
  void take(std::uint64_t num_bytes);
  void give_back(std::uint64_t num_bytes) {
    num_bytes_.fetch_sub(num_bytes, std::memory_order_relaxed);
  }
  /// Calls work(), which takes memory. A thread alone makes room for it.
  template <class Work>
  void with_room(Work work) {
    if (!is_alone_) return work();
    try {
      work();
    } catch (const NoRoom &) {
      drop();
      work();
    }
  }

 private:
  void drop() {
    for (const std::function<void()> &drop : drops_) drop();
  }

  std::uint64_t limit_;
  std::uint32_t num_threads_;
  std::atomic<std::uint64_t> num_bytes_ = 0;
  bool is_alone_ = false;
  std::vector<std::function<void()>> drops_;
};

}  // namespace isowave::core
