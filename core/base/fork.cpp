#include "core/base/fork.hpp"

#include <atomic>
#include <mutex>

#include "core/base/error.hpp"
#include "core/platform/process.hpp"

namespace isowave::core {

namespace {

std::atomic<bool> has_threads = false, has_lost_threads = false;

}  // namespace

bool is_forked() {
  return has_lost_threads;
}

void begin_threads() {
  static std::once_flag once;
  std::call_once(once, platform::call_in_forks, [] {
    if (has_threads) has_lost_threads = true;
  });
  has_threads = true;
}

void check_not_forked() {
  if (!is_forked()) return;
  throw Error(
      "this process was forked from one that had used isowave, whose threads and OpenCL devices do "
      "not survive a fork: start processes anew (in Python, multiprocessing's start method "
      "'spawn'), or fork before isowave is used");
}

}  // namespace isowave::core
