// core/base/loop_on_threads: what parallel_for() promises, without oneTBB.

#include "core/base/loop_on_threads.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace isowave::core {
namespace {

using testing::ThrowsMessage;

bool each_once(const std::vector<std::atomic<int>> &done) {
  return std::ranges::all_of(done, [](const std::atomic<int> &times) { return times == 1; });
}

TEST(LoopOnThreads, DoesEachItemOnce) {
  for (const std::uint64_t num_items : {0, 1, 2, 3, 63, 64, 65, 1000, 100001}) {
    for (const std::uint32_t num_threads : {1, 2, 3, 8}) {
      SCOPED_TRACE(testing::Message() << num_items << " items, " << num_threads << " threads");
      std::vector<std::atomic<int>> done(num_items);
      std::atomic<std::uint32_t> largest = 0;
      loop_on_threads(num_items, num_threads, [&](std::uint64_t item, std::uint32_t thread) {
        ++done[item];
        std::uint32_t before = largest;
        while (before < thread && !largest.compare_exchange_weak(before, thread)) {
        }
      });
      EXPECT_TRUE(each_once(done));
      EXPECT_LT(largest, num_threads);
    }
  }
}

/// Two threads wait for each other, so both must be there.
TEST(LoopOnThreads, ThreadsWorkAtTheSameTime) {
  std::atomic<int> num_here = 0;
  loop_on_threads(2, 2, [&](std::uint64_t, std::uint32_t) {
    ++num_here;
    while (num_here < 2) std::this_thread::yield();
  });
  EXPECT_EQ(num_here, 2);
}

/// A number that two threads had at a time would make them share what a thread has to itself.
TEST(LoopOnThreads, NoTwoThreadsHaveOneNumber) {
  std::vector<std::atomic<bool>> is_busy(4);
  loop_on_threads(4000, 4, [&](std::uint64_t, std::uint32_t thread) {
    EXPECT_FALSE(is_busy[thread].exchange(true));
    std::this_thread::yield();
    is_busy[thread] = false;
  });
}

TEST(LoopOnThreads, AnExceptionStopsTheLoopAndIsHandedOn) {
  for (const std::uint32_t num_threads : {1, 4}) {
    std::atomic<int> num_done = 0;
    const auto run = [&] {
      loop_on_threads(1000000, num_threads, [&](std::uint64_t item, std::uint32_t) {
        if (item == 10) throw std::runtime_error("item 10");
        ++num_done;
      });
    };
    EXPECT_THAT(run, ThrowsMessage<std::runtime_error>("item 10"));
    EXPECT_LT(num_done, 999999);
    loop_on_threads(4, num_threads, [&](std::uint64_t, std::uint32_t) { ++num_done; });
  }
}

TEST(LoopOnThreads, LoopsWithinLoopsDoAll) {
  std::vector<std::atomic<int>> done(20 * 30);
  loop_on_threads(20, 4, [&](std::uint64_t outer, std::uint32_t) {
    loop_on_threads(30, 4, [&](std::uint64_t inner, std::uint32_t thread) {
      EXPECT_LT(thread, 4u);
      ++done[outer * 30 + inner];
    });
  });
  EXPECT_TRUE(each_once(done));
}

/// The failure of an inner loop is its caller's, and so the outer loop's.
TEST(LoopOnThreads, ExceptionsLeaveLoopsWithinLoops) {
  const auto run = [] {
    loop_on_threads(8, 4, [](std::uint64_t outer, std::uint32_t) {
      loop_on_threads(8, 4, [&](std::uint64_t inner, std::uint32_t) {
        if (outer == 3 && inner == 5) throw std::runtime_error("3, 5");
      });
    });
  };
  EXPECT_THAT(run, ThrowsMessage<std::runtime_error>("3, 5"));
}

}  // namespace
}  // namespace isowave::core
