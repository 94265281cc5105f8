#include "core/base/loop_on_threads.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace isowave::core {

namespace {

/// Pieces of the loop for each thread, so that threads end at about the same time.
constexpr std::uint64_t kPiecesPerThread = 16;

thread_local bool is_in_loop = false;

/// A loop at work on several threads.
class Loop {
 public:
  using Body = std::function<void(std::uint64_t item, std::uint32_t thread)>;

  Loop(std::uint64_t num_items, std::uint32_t num_threads, const Body &body)
      : num_items_(num_items),
        piece_(std::max<std::uint64_t>(num_items / (kPiecesPerThread * num_threads), 1)),
        body_(body) {}

  /// Takes pieces until none is left. Called by each thread.
  void work(std::uint32_t thread) noexcept {
    const bool was_in_loop = std::exchange(is_in_loop, true);
    try {
      for (;;) {
        const std::uint64_t begin = next_.fetch_add(piece_, std::memory_order_relaxed);
        if (begin >= num_items_) break;
        const std::uint64_t end = begin + std::min(piece_, num_items_ - begin);
        for (std::uint64_t item = begin; item < end && !has_failed_; ++item) body_(item, thread);
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
      has_failed_ = true;
      next_ = num_items_;
    }
    is_in_loop = was_in_loop;
  }

  /// After all threads. Throws what a body threw first.
  void finish() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::uint64_t num_items_, piece_;
  const Body &body_;
  std::atomic<std::uint64_t> next_ = 0;
  std::atomic<bool> has_failed_ = false;
  std::mutex mutex_;
  std::exception_ptr failure_;
};

}  // namespace

void loop_on_threads(std::uint64_t num_items, std::uint32_t num_threads,
                     const std::function<void(std::uint64_t item, std::uint32_t thread)> &body) {
  const auto most = static_cast<std::uint32_t>(std::min<std::uint64_t>(num_threads, num_items));
  if (most <= 1 || is_in_loop) {
    for (std::uint64_t item = 0; item < num_items; ++item) body(item, 0);
    return;
  }
  Loop loop(num_items, most, body);
  {
    std::vector<std::jthread> threads;
    try {
      threads.reserve(most - 1);
      for (std::uint32_t thread = 1; thread < most; ++thread)
        threads.emplace_back([&loop, thread] { loop.work(thread); });
    } catch (const std::system_error &) {
      // The system has no more threads to give.
    }
    loop.work(0);
  }
  loop.finish();
}

}  // namespace isowave::core
