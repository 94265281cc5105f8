#include "core/host/host_room.hpp"

#include <algorithm>

#include "core/base/parallel_for.hpp"

namespace isowave::core {

void HostRoom::hold(std::uint64_t num_bytes) {
  num_bytes_ += num_bytes;
  if (num_bytes_ > limit_) drop();
}

void HostRoom::take(std::uint64_t num_bytes) {
  if (num_bytes_.fetch_add(num_bytes, std::memory_order_relaxed) + num_bytes <= limit_) return;
  give_back(num_bytes);
  throw NoRoom();
}

void HostRoom::run(std::uint64_t num_items,
                   const std::function<void(std::uint64_t item, bool is_alone)> &work) {
  std::vector<unsigned char> is_done(num_items);
  for (;;) {
    std::atomic<bool> any_done = false;
    try {
      parallel_for(num_items, num_threads_, [&](std::uint64_t item, std::uint32_t) {
        if (is_done[item] != 0) return;
        work(item, false);
        is_done[item] = 1;
        any_done.store(true, std::memory_order_relaxed);
      });
      return;
    } catch (const NoRoom &) {
      drop();
    }
    if (any_done) continue;
    const auto next = std::ranges::find(is_done, 0);
    is_alone_ = true;
    try {
      work(static_cast<std::uint64_t>(next - is_done.begin()), true);
    } catch (...) {
      is_alone_ = false;
      throw;
    }
    is_alone_ = false;
    *next = 1;
  }
}

}  // namespace isowave::core
