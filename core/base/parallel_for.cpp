#include "core/base/parallel_for.hpp"

#include <algorithm>
#include <thread>

#include "core/base/fork.hpp"

#ifdef ISOWAVE_HAS_TBB
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#else
#include "core/base/loop_on_threads.hpp"
#endif

namespace isowave::core {

std::uint32_t thread_count(std::uint32_t requested) {
  return requested > 0 ? std::min(requested, kMaxThreads)
                       : std::max(1u, std::thread::hardware_concurrency());
}

void parallel_for(std::uint64_t num_items, std::uint32_t num_threads,
                  const std::function<void(std::uint64_t item, std::uint32_t thread)> &body) {
  if (is_forked()) {  // TBB's threads are not there
    for (std::uint64_t item = 0; item < num_items; ++item) body(item, 0);
    return;
  }
  // More threads than processors do not help, and TBB warns of them.
  const std::uint32_t threads = std::min(thread_count(num_threads), thread_count(0));
#ifdef ISOWAVE_HAS_TBB
  begin_threads();
  // A new arena, so that a thread's number is below the count even if a task of oneTBB calls.
  tbb::task_arena arena(static_cast<int>(threads));
  arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::uint64_t>(0, num_items), [&](const auto &range) {
      const auto thread = static_cast<std::uint32_t>(tbb::this_task_arena::current_thread_index());
      for (std::uint64_t item = range.begin(); item < range.end(); ++item) body(item, thread);
    });
  });
#else
  loop_on_threads(num_items, threads, body);
#endif
}

}  // namespace isowave::core
