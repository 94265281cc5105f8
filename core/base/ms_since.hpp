#pragma once
// Wall clock of a piece of work, by the steady clock.

#include <chrono>

namespace isowave::core {

/// Wall clock since then [ms].
inline double ms_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

}  // namespace isowave::core
