#pragma once
// How a process waits for others that may draw on the same processor.

#include <mpi.h>

#include <chrono>
#include <span>
#include <thread>

namespace isowave::core::tools {

/// Waits as fast as a processor can at first, then with naps: others may draw on that processor.
class Wait {
 public:
  template <class IsDone>
  void operator()(const IsDone &is_done) const {
    constexpr std::chrono::milliseconds kFast{1};
    constexpr std::chrono::microseconds kNap{50};
    while (!is_done()) {
      if (std::chrono::steady_clock::now() - begin_ > kFast) {
        std::this_thread::sleep_for(kNap);
      } else {
        std::this_thread::yield();
      }
    }
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

inline void wait_for(std::span<MPI_Request> requests) {
  Wait()([&] {
    int done = 0;
    MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE);
    return done != 0;
  });
}

}  // namespace isowave::core::tools
