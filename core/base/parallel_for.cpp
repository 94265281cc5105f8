#include "core/base/parallel_for.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace isowave::core {

std::uint32_t thread_count(std::uint32_t requested) {
  return requested > 0 ? std::min(requested, kMaxThreads)
                       : std::max(1u, std::thread::hardware_concurrency());
}

void parallel_for(std::uint64_t num_items, std::uint32_t num_threads,
                  const std::function<void(std::uint64_t item, std::uint32_t thread)> &body) {
  std::atomic<std::uint64_t> next{0};
  std::mutex mutex;
  std::exception_ptr first_error;
  const auto work = [&](std::uint32_t thread) {
    try {
      for (std::uint64_t item; (item = next.fetch_add(1)) < num_items;) body(item, thread);
    } catch (...) {
      next.store(num_items);
      const std::lock_guard lock(mutex);
      if (!first_error) first_error = std::current_exception();
    }
  };
  const auto count = std::uint32_t(std::min<std::uint64_t>(thread_count(num_threads), num_items));
  {
    std::vector<std::jthread> threads;
    for (std::uint32_t thread = 1; thread < count; ++thread) threads.emplace_back(work, thread);
    work(0);
  }
  if (first_error) std::rethrow_exception(first_error);
}

}  // namespace isowave::core
