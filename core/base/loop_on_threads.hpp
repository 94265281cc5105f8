#pragma once
// A loop on threads of the standard library, for builds without oneTBB.

#include <cstdint>
#include <functional>

namespace isowave::core {

/// parallel_for() with threads that live as long as the loop. The calling thread is number 0. A
/// loop within a body of another one stays on its thread, since the other threads are busy. If the
/// system starts fewer threads than wanted, those that there are do all.
///
/// num_threads  at least 1
void loop_on_threads(std::uint64_t num_items, std::uint32_t num_threads,
                     const std::function<void(std::uint64_t item, std::uint32_t thread)> &body);

}  // namespace isowave::core
