#pragma once
// Waiting until another thread changes an atomic. std::atomic::wait() of libstdc++ 12 may wait for
// ever: on Windows a notify_all() between its look at the value and its sleep wakes nothing, and on
// Linux one before its look at its own counter does so for types shorter than a futex.

#include <atomic>
#include <functional>
#include <thread>

namespace isowave::core {

/// Sleeps until is_over() holds. A lock is held during is_over(), which is called first at once,
/// then after each wake_sleepers() of this address. The address is a name: nothing reads there.
///
/// Throws  what is_over() throws
void sleep_until(const void *address, const std::function<bool()> &is_over);

/// Has all threads that sleep by this address look again. Called after the sequentially consistent
/// store of what is_over() loads. Costs one load if no thread sleeps.
void wake_sleepers(const void *address);

/// Waits as long as the atomic has this value, which set_and_wake() changes. Short waits spin.
template <class T>
void wait_while(const std::atomic<T> &state, T value) {
  constexpr int kYields = 16;
  for (int i = 0; i < kYields; ++i) {
    if (state != value) return;
    std::this_thread::yield();
  }
  sleep_until(&state, [&] { return state != value; });
}

/// Sets the atomic, and wakes all threads in wait_while(). They may destroy it at once.
template <class T>
void set_and_wake(std::atomic<T> &state, T value) {
  state = value;
  wake_sleepers(&state);
}

}  // namespace isowave::core
