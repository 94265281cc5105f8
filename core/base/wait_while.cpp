#include "core/base/wait_while.hpp"

#include <array>
#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace isowave::core {

namespace {

/// Addresses share these: a thread may be woken for another's sake, and looks again.
struct Bed {
  std::atomic<std::uint32_t> num_sleepers = 0;
  std::mutex mutex;
  std::condition_variable changed;
};

Bed &bed_of(const void *address) {
  // Never destroyed: threads may sleep while the program ends.
  static auto &beds = *new std::array<Bed, 64>;
  const auto number = reinterpret_cast<std::uintptr_t>(address);
  return beds[(number ^ (number >> 6) ^ (number >> 12)) % beds.size()];
}

}  // namespace

// Either the sleeper's look sees what was stored before wake_sleepers(), or wake_sleepers() sees
// the sleeper, whose number was added before. In the latter case the lock makes wake_sleepers()
// wait until the sleeper sleeps.
void sleep_until(const void *address, const std::function<bool()> &is_over) {
  Bed &bed = bed_of(address);
  std::unique_lock lock(bed.mutex);
  struct Sleeper {
    std::atomic<std::uint32_t> &count;
    explicit Sleeper(std::atomic<std::uint32_t> &sleepers) : count(sleepers) { ++count; }
    ~Sleeper() { --count; }
  } const sleeper(bed.num_sleepers);
  bed.changed.wait(lock, is_over);
}

void wake_sleepers(const void *address) {
  Bed &bed = bed_of(address);
  if (bed.num_sleepers == 0) return;
  { const std::lock_guard lock(bed.mutex); }
  bed.changed.notify_all();
}

}  // namespace isowave::core
