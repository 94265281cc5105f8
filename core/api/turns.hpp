#pragma once
// Private to core/api: calls that take turns, from any number of threads.

#include <atomic>
#include <mutex>
#include <thread>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/fork.hpp"

namespace isowave {

/// A mutex that does not wait for the thread that asks: a call from on_pass, or from another
/// callback, of the call that has the turn gets an Error.
class Turns {
 public:
  /// Throws  core::Error: this thread has the turn; the process was forked (check_not_forked())
  void lock() {
    core::check_not_forked();
    if (is_mine()) {
      throw core::Error(
          "this renderer or its device is at work, and waits for the callback that makes this "
          "call: use it afterwards, or make another one with a device of its own");
    }
    mutex_.lock();
    owner_ = std::this_thread::get_id();
  }
  void unlock() {
    if (Turns *const taken = std::exchange(taken_, nullptr)) taken->unlock();
    owner_ = std::thread::id();
    mutex_.unlock();
  }
  /// Takes a turn of others, too, which ends with this one. This thread has the turn.
  ///
  /// Throws  as lock(), unless it was taken before in this turn
  void take(Turns &others) {
    if (taken_ == &others) return;
    others.lock();
    taken_ = &others;
  }
  /// Whether this thread has the turn.
  bool is_mine() const { return owner_ == std::this_thread::get_id(); }

 private:
  std::mutex mutex_;
  std::atomic<std::thread::id> owner_{};
  Turns *taken_ = nullptr;  ///< by the thread that has the turn
};

/// A turn for what may also be done within a call that has the turn.
class TurnOrMine {
 public:
  explicit TurnOrMine(Turns &turns) : lock_(turns, std::defer_lock) {
    if (!turns.is_mine()) lock_.lock();
  }

 private:
  std::unique_lock<Turns> lock_;
};

}  // namespace isowave
