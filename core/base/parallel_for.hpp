#pragma once
// Host threads for loops of independent items.

#include <cstdint>
#include <functional>

namespace isowave::core {

inline constexpr std::uint32_t kMaxThreads = 1024;
/// Threads used for `requested`: 0 means one per processor; never more than kMaxThreads.
std::uint32_t thread_count(std::uint32_t requested);

/// Calls body(item, thread) once for each item in [0, num_items), in any order, from up to
/// `num_threads` threads (0: one per processor); thread is in [0, thread_count(num_threads)).
/// Returns when all are done. An exception stops the hand-out of further items and is rethrown
/// here; of several, one is. May be called from several threads, and from a body. In a
/// process that was forked (core/base/fork.hpp), the calling thread does everything.
void parallel_for(std::uint64_t num_items, std::uint32_t num_threads,
                  const std::function<void(std::uint64_t item, std::uint32_t thread)> &body);

}  // namespace isowave::core
