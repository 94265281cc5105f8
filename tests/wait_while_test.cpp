// core/base/wait_while: no thread sleeps on after what it waits for.

#include "core/base/wait_while.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <stdexcept>
#include <vector>

namespace isowave::core {
namespace {

/// Long enough for any machine. A test that has to wait so long fails.
constexpr std::chrono::seconds kEver{60};

TEST(WaitWhile, ReturnsAtOnceIfTheValueIsAnother) {
  const std::atomic<bool> state = true;
  wait_while(state, false);
}

TEST(WaitWhile, AllThatSleepAreWoken) {
  std::atomic<unsigned char> state = 1;
  std::atomic<int> num_looking = 0;
  std::vector<std::future<void>> sleepers;
  sleepers.reserve(4);
  for (int i = 0; i < 4; ++i) {
    sleepers.push_back(std::async(std::launch::async, [&] {
      sleep_until(&state, [&] {
        ++num_looking;
        return state == 2;
      });
    }));
  }
  while (num_looking < 4) std::this_thread::yield();
  set_and_wake(state, static_cast<unsigned char>(3));
  while (num_looking < 8) std::this_thread::yield();
  set_and_wake(state, static_cast<unsigned char>(2));
  for (const std::future<void> &sleeper : sleepers)
    EXPECT_EQ(sleeper.wait_for(kEver), std::future_status::ready);
}

/// The waker comes after the sleeper's look, and before its sleep.
TEST(WaitWhile, IsWokenByWhatCameBetweenLookAndSleep) {
  std::atomic<bool> state = false, is_waking = false;
  std::future<void> waker;
  std::future<void> sleeper = std::async(std::launch::async, [&] {
    sleep_until(&state, [&] {
      const bool is_over = state;
      if (!waker.valid()) {
        waker = std::async(std::launch::async, [&] {
          state = true;
          is_waking = true;
          wake_sleepers(&state);
        });
        while (!is_waking) std::this_thread::yield();
        std::this_thread::sleep_for(
            std::chrono::milliseconds(50));  // time for a waker that does not wait for the sleep
      }
      return is_over;
    });
  });
  EXPECT_EQ(sleeper.wait_for(kEver), std::future_status::ready);
  wake_sleepers(&state);  // ends the test if it fails
  sleeper.get();
  waker.get();
}

TEST(WaitWhile, ThrowsWhatTheConditionThrows) {
  const std::atomic<int> state = 0;
  EXPECT_THROW(sleep_until(&state, []() -> bool { throw std::runtime_error("stop"); }),
               std::runtime_error);
  wake_sleepers(&state);  // its lock is free
}

/// Two threads make the same things one after the other; each waits for what the other makes.
TEST(WaitWhile, ThreadsThatMeetOftenNeverWaitForEver) {
  constexpr unsigned char kNone = 0, kBeingMade = 1, kMade = 2;
  constexpr int kStates = 50000;
  std::vector<std::atomic<unsigned char>> states(kStates);
  std::atomic<int> num_made = 0;
  const auto make_all = [&] {
    for (std::atomic<unsigned char> &state : states) {
      unsigned char seen = kNone;
      if (state.compare_exchange_strong(seen, kBeingMade)) {
        ++num_made;
        set_and_wake(state, kMade);
      } else {
        wait_while(state, kBeingMade);
      }
    }
  };
  std::future<void> other = std::async(std::launch::async, make_all);
  make_all();
  ASSERT_EQ(other.wait_for(kEver), std::future_status::ready);
  EXPECT_EQ(num_made, kStates);
}

}  // namespace
}  // namespace isowave::core
